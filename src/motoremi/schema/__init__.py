"""What a procedure and a bench file may say; checked before any instrument is connected."""

"""Links to instruments, the recording and replay of their traffic, and the base classes of all drivers."""

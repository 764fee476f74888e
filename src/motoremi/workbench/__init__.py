"""The local web page: watch a sweep arrive, see where the model fails, click an effect and see the error fall."""

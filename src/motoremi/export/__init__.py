"""The model and the data in the formats of other programs: CSV, Parquet, HDF5, xarray, Touchstone, SPICE."""

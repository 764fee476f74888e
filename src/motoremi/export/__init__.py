"""Export of model and data to the formats of other programs: CSV, Parquet, HDF5, xarray, Touchstone, SPICE."""

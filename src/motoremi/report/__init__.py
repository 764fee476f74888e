"""The report: `model` makes its content; `html`, `pdf`, `junit` and `machine_readable` render it; `renderings` writes all files."""

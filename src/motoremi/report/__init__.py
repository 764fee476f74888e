"""One report model, many renderings: `model` makes it, `html`, `junit` and `data` write it, `files` names the results."""

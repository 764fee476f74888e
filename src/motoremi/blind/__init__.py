"""The blind test: sealed challenges and the scoreboard. Data come from `simulate`, which shares no formula with the catalogue."""

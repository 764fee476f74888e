"""What a fitted model leaves: where it fails, what any linear circuit would reach, what an element would have to be, whether the sweeps agree."""

"""Virtual instruments: simulated analysers, receivers, supplies and meters behind PyVISA, the simulated bench that holds them, and faults."""

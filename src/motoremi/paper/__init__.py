"""Reproduction of Liu, Wang and Nan (2011): Fig. 6 - 8 on simulated data, and checks of the printed numbers against each other."""

"""Liu, Wang and Nan (2011) reproduced: Fig. 6 - 8 on simulated data, and where the printed numbers do not agree."""

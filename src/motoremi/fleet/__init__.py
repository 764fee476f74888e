"""A fleet: all sessions below one folder, fitted and diagnosed on local processes or a cluster, with statistics over all of them.

`work` analyses one session, `run` submits the sessions and stores the results, `statistics` and `page` summarise them, `fleet_frames` gives tables.
"""

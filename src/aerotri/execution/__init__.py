"""Independent tasks in threads, in processes of this machine, or on many machines by Dask.

This room knows tasks, not photogrammetry: a function of a module, what all tasks share, and a record for every task.
Tasks may run twice and beside one another; they write whole files and give back little.
"""

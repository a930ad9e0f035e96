"""The adjustment beside its peers: blocks, measurements in processes of their own, table and plot."""

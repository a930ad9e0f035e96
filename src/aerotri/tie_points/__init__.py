"""From a folder of photographs to a block: features, matches, tracks, first orientation, control to be marked."""

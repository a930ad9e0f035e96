"""Blocks in parts: divided, each part eliminated by itself, and the exact adjustment of the whole from what they leave.

A part is a block of its own: photographs, all rays of its points, its control. Photographs that stand in several parts
are shared; no point does. Every part eliminates its points and the photographs that are its own, and what is left of
all parts are the normal equations of the shared photographs and the shared parameters. The numbers are those of the
adjustment in one piece. Parts are tasks, wherever they run; they exchange files.
"""

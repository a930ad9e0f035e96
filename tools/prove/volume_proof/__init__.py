"""Simulated pickets on ground of known volume: is the stated σ of a volume its scatter?"""

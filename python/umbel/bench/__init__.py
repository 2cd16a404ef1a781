"""Comparisons with other libraries, each a module: what is timed, its table, its charts.

A comparison runs all its methods in one process and lets them take turns, so that other
work of the machine disturbs all of them alike.
"""

"""OFFIS, the optical-flow fuzzy inference system (paper sec 4 and 5).

A derotated flow field goes in; metric nearness with labels (floor, obstacle, drop, above) and the
paper's fuzzy knowledge (nearest objects, planes, slopes, elementary situations) come out.
"""

"""The paper's experiments: who learns what, how fast, and what the paper says of it.

References:
    [GK] Guralnik and Koditschek, "Universal Memory Architectures for Autonomous
    Machines", sections "Performance of Empirical Agents" and "Performance Analysis"
    (of discounted snapshots).
"""

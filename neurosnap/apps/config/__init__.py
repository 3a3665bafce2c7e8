"""Configuration: the TOML file that describes a run.

`tables` says what may stand in it, `check` finds all that is wrong with it and `lines`
where that stands, `load` reads it, `prepare` makes of it what a run is started with.
"""

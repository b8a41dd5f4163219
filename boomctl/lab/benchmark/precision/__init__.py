"""Run time against error of everything that a user does, ours and others' alike: measured, drawn, and read for settings."""

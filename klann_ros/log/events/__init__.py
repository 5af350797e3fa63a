"""Runs of events: nothing is written until there is a cause, then also what came before it."""

"""Any crank-driven linkage of N bars, from data: its loop equations follow from its bodies."""

"""A data sheet as one HTML page that opens offline."""

from .page import page

__all__ = ['page']

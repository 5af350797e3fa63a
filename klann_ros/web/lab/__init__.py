"""The lab: a page of one file in which any linkage is changed, turned and solved by hand."""

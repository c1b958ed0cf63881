"""The sections of a result: one frozen class each, made by its `of` from what was computed.

A class says what its part of `result.json` holds and prints it on the console; its page is the
template of the field's name in `report_page/templates`. Nothing is read or written here. Begin with
`section.py` and `average.py`.
"""

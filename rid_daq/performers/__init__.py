"""What commands do: one file a command, its request carried out and what came of it said.

Options and their parsing stand in `rid_daq/commands`, which import these when they are called;
what is computed stands in the jobs. Those on payloads and on paths have rooms of their own.
Begin with `record.py`.
"""

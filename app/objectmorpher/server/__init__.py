"""Job functions that run on another machine: the protocol, its client and its server.

`message.py` puts values on the wire, `table.py` says which functions and which types there are,
`client.py` asks, `front.py` answers by means of a runner (`alone.py`, `cluster.py`).
"""

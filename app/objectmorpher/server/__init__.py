"""Job functions that run on another machine; and the editor in a browser.

`message.py` puts values on the wire, `table.py` says which functions and which types there are,
`client.py` asks, `front.py` answers by means of a runner (`running.py`, `cluster.py`).
`web_editor.py` serves the editor, with the page of `share_page.py` in it.
"""

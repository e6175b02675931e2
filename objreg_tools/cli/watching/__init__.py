# SPDX-License-Identifier: Apache-2.0
"""The page of `objreg watch`: `watched.py` keeps what a graph published last, `topics.py` fills it, `server.py` shows
it. What a place looks as from above is thinned by `thinned.py`. `reports.py` reads what a node says of itself,
`listening.py` runs the node that listens, and `local_pages.py` serves pages to this machine."""

# SPDX-License-Identifier: Apache-2.0
"""The metrics of `objreg metrics`: `observed.py` keeps what the nodes reported last, `families.py` declares each metric
and what it reads of a report, and `exposition.py` writes them as Prometheus reads them."""

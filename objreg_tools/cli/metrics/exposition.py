# SPDX-License-Identifier: Apache-2.0
"""Metrics as text that Prometheus reads: OpenMetrics for who asks for it, else Prometheus' own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from objreg_ros import extra
from objreg_tools.cli.metrics.families import FAMILIES, Family
from objreg_tools.cli.metrics.observed import Observation, Observed
from objreg_tools.cli.watching.local_pages import Answer

OPEN_METRICS = "application/openmetrics-text"
TEXT = 300  # characters of a label that another node gave
LARGEST = 2**63  # a counter has 64 bits


class Exposition:
    """Writes what is observed; ValueError that names the extra where prometheus_client is not installed."""

    def __init__(self, observed: Observed) -> None:
        self._observed = observed
        self._client: Any = extra.load("prometheus_client", "metrics", "objreg metrics")
        self._core: Any = extra.load("prometheus_client.core", "metrics", "objreg metrics")
        self._open: Any = extra.load("prometheus_client.openmetrics.exposition", "metrics", "objreg metrics")

    def pages(self, path: str, accept: str) -> Answer | None:
        """The metrics at `/metrics`, in a form that ``accept`` allows; None for another path."""
        if path != "/metrics":
            return None
        form = self._open if OPEN_METRICS in accept else self._client
        return Answer(form.generate_latest(self), form.CONTENT_TYPE_LATEST)

    def collect(self) -> Iterator[Any]:
        """Every metric of which there is a sample, as prometheus_client takes it from a registry."""
        nodes = self._observed.nodes()
        for family in FAMILIES:
            made = self._made(family, nodes)
            if made.samples:
                yield made

    def _made(self, family: Family, nodes: dict[str, Observation]) -> Any:
        kind = self._core.CounterMetricFamily if family.is_counter else self._core.GaugeMetricFamily
        made = kind(family.name, family.doc, labels=("node", *family.labels), unit=family.unit)
        samples = dict[tuple[str, ...], float]()  # two of the same labels would have Prometheus refuse all
        for name, node in nodes.items():
            for labels, number in family.of(node):
                if abs(number) <= LARGEST:  # not that of a node that reports nonsense
                    samples.setdefault(tuple(label[:TEXT] for label in (name, *labels)), float(number))
        for labels, number in samples.items():
            made.add_metric(labels, number)
        return made

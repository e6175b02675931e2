# SPDX-License-Identifier: Apache-2.0
"""The weights of evidence behind the gate (`gate/weights.py`), fitted on simulated sensors, and whether they are true.

    python -m training.likelihood gather --first-seed 8100 --out EVIDENCE     # 36 recordings, an hour on two cores
    python -m training.likelihood fit EVIDENCE --write
    python -m training.likelihood check OTHERS                 # recordings that were not fitted to
    python -m training.likelihood fresh --first-seed 20100     # gather such ones and check them

An additive logistic model: the logarithm of the odds is the sum of one function for each kind of evidence, piecewise
linear, and monotone by bounds on its slopes. Right and false poses weigh the same in sum. `fit` leaves out one sensor
after the other as well, and says what is accepted of it with and without it.
"""

from __future__ import annotations

import json
import multiprocessing
import textwrap
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from scipy.optimize import minimize
from tqdm import tqdm

from objreg_ros.data.checked import Array
from objreg_ros.registration.gate import weights as shipped
from objreg_ros.registration.gate.kinds import KINDS
from objreg_ros.registration.gate.likelihood import ODDS
from objreg_tools.truth import FALSE, LOOSE
from training.evidence import Plan, Rows, gather, plans

PENALTY = 1e-3  # of squared weights: what the rows hardly constrain weighs little
LARGEST = 8.0  # natural logarithm that one step of a weight may have
THRESHOLDS = (1.0, 3.0, 10.0, 30.0, ODDS, 100.0, 300.0)
WRITTEN = Path(shipped.__file__)


class Fit(NamedTuple):
    """The prior, and by kind the weights at its knots and that of what is unknown: decimal logarithms."""

    prior: float
    weights: dict[str, tuple[float, ...]]
    unknown: dict[str, float]


SHIPPED = Fit(shipped.PRIOR, shipped.WEIGHTS, shipped.UNKNOWN)


def steps_of(readings: Array) -> tuple[Array, list[tuple[str, str]]]:
    """How far each reading (N, kinds) is through each segment between knots, (N, columns) 0..1, or whether it is none.

    With the kind of each column, and ``rise`` or ``unknown``.
    """
    columns, names = [], []
    for (name, kind), values in zip(KINDS.items(), readings.T, strict=True):
        unknown, knots = np.isnan(values), np.array(kind.knots)
        through = np.clip((values[:, None] - knots[:-1]) / np.diff(knots), 0.0, 1.0)
        through = through if kind.rises else 1.0 - through
        columns += [*np.where(unknown[:, None], 0.0, through).T, unknown.astype(float)]
        names += [(name, "rise")] * (len(knots) - 1) + [(name, "unknown")]
    return np.array(columns).T, names


def fit(rows: Rows) -> Fit:
    """The most likely weights of rows that are right or false; what is between is left out."""
    right, false = begun_summary(rows)
    known = right | false
    steps, names = steps_of(rows.readings[known])
    sign, share = np.where(right[known], 1.0, -1.0), balanced(right[known])

    def loss(x: Array) -> tuple[float, Array]:
        margin = sign * (steps @ x[:-1] + x[-1])
        slope = -sign * share / (1.0 + np.exp(margin))
        value = share @ np.logaddexp(0.0, -margin) + 0.5 * PENALTY * x[:-1] @ x[:-1]
        return float(value), np.append(steps.T @ slope + PENALTY * x[:-1], slope.sum())

    bounds = [(0.0 if what == "rise" else -LARGEST, LARGEST) for _, what in names]
    found = minimize(loss, np.zeros(len(names) + 1), jac=True, method="L-BFGS-B", bounds=[*bounds, (None, None)])
    return centred(found.x / np.log(10.0), names, steps, share)


def balanced(right: Array) -> Array:
    """The share of each row (N,), so that right and false ones have one half each."""
    return np.asarray(np.where(right, 0.5 / max(1, right.sum()), 0.5 / max(1, (~right).sum())))


def centred(x: Array, names: Sequence[tuple[str, str]], steps: Array, share: Array) -> Fit:
    """The fit with 0 for what a kind says on average, so that it is also what a kind says that no row lacks."""
    weights, unknown, prior = {}, {}, float(x[-1])
    for name, kind in KINDS.items():
        rises, (lacks,) = (
            np.array([k for k, n in enumerate(names) if n == (name, what)]) for what in ("rise", "unknown")
        )
        at_knots = (
            np.append(0.0, np.cumsum(x[rises])) if kind.rises else np.append(np.cumsum(x[rises][::-1])[::-1], 0.0)
        )
        mean = float(share @ (steps[:, [*rises, lacks]] @ x[[*rises, lacks]]))
        weights[name] = tuple(float(w) for w in np.round(at_knots - mean, 3))
        unknown[name] = round(float(x[lacks]) - mean, 3) if steps[:, lacks].any() else 0.0
        prior += mean
    return Fit(round(prior, 3), weights, unknown)


def log_odds(found: Fit, readings: Array) -> Array:
    """The decimal logarithm (N,) of the odds of readings (N, kinds)."""
    total = np.full(len(readings), found.prior)
    for (name, kind), values in zip(KINDS.items(), readings.T, strict=True):
        weight = np.interp(np.nan_to_num(values), kind.knots, found.weights[name])
        total += np.where(np.isnan(values), found.unknown[name], weight)
    return total


def begun_summary(rows: Rows) -> tuple[Array, Array]:
    """Which rows (N,) are loosely right, and which are false."""
    return np.asarray((rows.error < LOOSE).all(axis=1)), np.asarray((rows.error > FALSE).any(axis=1))


def accepted(rows: Rows, odds: Array, least: float) -> Array:
    """Which rows (N,) the gate accepts: the first of each pair with no less than such odds that no rule refuses."""
    may = (odds >= np.log10(least)) & ~rows.refused
    order = np.lexsort((rows.rank, rows.pair))
    chosen = order[may[order]]
    _, first = np.unique(rows.pair[chosen], return_index=True)
    taken = np.zeros(len(rows), bool)
    taken[chosen[first]] = True
    return taken


def reliability(rows: Rows, odds: Array) -> list[dict[str, float]]:
    """By least odds: how many are accepted, right and false, and how many false ones the odds of each foretell.

    Foretold as if as many false as right poses were asked about, brought to how many there are.
    """
    right, false = begun_summary(rows)
    prior = right.sum() / max(1, false.sum())
    table = []
    for least in THRESHOLDS:
        taken = accepted(rows, odds, least)
        predicted = float((1.0 / (1.0 + prior * 10.0 ** odds[taken])).sum())
        table.append(
            {
                "odds": least,
                "accepted": int(taken.sum()),
                "right": int((taken & right).sum()),
                "false": int((taken & false).sum()),
                "predicted": round(predicted, 1),
                "recall": round(float((taken & right).sum() / max(1, closable(rows))), 3),
            }
        )
    return table


def closable(rows: Rows) -> int:
    """How many pairs there are whose best pose is right."""
    right, _ = begun_summary(rows)
    return int((right & (rows.rank == 0)).sum())


def show(table: Sequence[Mapping[str, float]], title: str) -> None:
    """Print a table of reliability."""
    click.echo(title)
    click.echo("  odds  accepted   right   false predicted  recall")
    for line in table:
        click.echo(
            f"{line['odds']:6.0f} {line['accepted']:9.0f} {line['right']:7.0f} {line['false']:7.0f} "
            f"{line['predicted']:9.1f} {line['recall']:7.3f}"
        )


def written(found: Fit, pairs: int, recordings: Sequence[str]) -> str:
    """The source of `gate/weights.py`; by the names of its recordings they can be made again."""
    lines = [
        "# SPDX-License-Identifier: Apache-2.0",
        '"""What each of the `kinds` of evidence weighs at its knots, in decimal logarithms; 0 is its average.',
        "",
        f"Written by `training/likelihood.py`, of {pairs} pairs of keyframes in {len(recordings)} simulated"
        " recordings. Their names have scenario, seed, sensor and rig:",
        *textwrap.wrap(", ".join(recordings), 118, break_on_hyphens=False),
        '"""',
        "",
        f"PRIOR = {found.prior}",
        "WEIGHTS = {",
        *(f'    "{name}": {weights},' for name, weights in found.weights.items()),
        "}",
        "UNKNOWN = {",
        *(f'    "{name}": {weight},' for name, weight in found.unknown.items()),
        "}",
    ]
    return "\n".join(lines) + "\n"


def _parts(folder: Path) -> list[Rows]:
    parts = [Rows.load(path) for path in sorted(folder.glob("*.npz"))]
    if not parts:
        raise click.ClickException(f"{folder}: expected files of `gather`, got none")
    return parts


@click.group()
def main() -> None:
    """Gather evidence of simulated recordings, fit its weights, check them."""


@main.command("gather")
@click.option("--first-seed", type=click.IntRange(min=0), required=True)
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True)
@click.option("--processes", type=click.IntRange(min=1), default=2, show_default=True)
def gather_command(first_seed: int, out: Path, processes: int) -> None:
    """Simulate rooms by every sensor, and write what the gate sees; what is there already is left as it is."""
    gather_into(out, plans(first_seed), processes)


def gather_into(out: Path, wanted: Sequence[Plan], processes: int) -> None:
    """Write the rows of each recording that is wanted and not there."""
    out.mkdir(parents=True, exist_ok=True)
    todo = [one for one in wanted if not (out / f"{one.name}.npz").exists()]
    with ProcessPoolExecutor(processes, multiprocessing.get_context("fork")) as pool:
        for one, rows in zip(todo, tqdm(pool.map(gather, todo), total=len(todo), unit="recording"), strict=True):
            rows.save(out / f"{one.name}.npz")


@main.command("fresh")
@click.option("--first-seed", type=click.IntRange(min=0), required=True, help="One that was not fitted to.")
@click.option("--every", type=click.IntRange(min=1), default=1, show_default=True, help="One of so many recordings.")
@click.option("--processes", type=click.IntRange(min=1), default=2, show_default=True)
@click.option("--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/odds"), show_default=True)
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path))
def fresh_command(first_seed: int, every: int, processes: int, keep: Path, json_file: Path | None) -> None:
    """Gather recordings, and judge them by the weights of the package."""
    wanted = plans(first_seed)[::every]
    gather_into(keep, wanted, processes)
    check(Rows.joined([Rows.load(keep / f"{one.name}.npz") for one in wanted]), json_file)


@main.command("fit")
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--write", is_flag=True, help="Write the weights into the package.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path))
def fit_command(folder: Path, write: bool, json_file: Path | None) -> None:
    """Fit the weights to FOLDER, and each sensor with those of the others."""
    parts = _parts(folder)
    rows = Rows.joined(parts)
    whole = fit(rows)
    apart = np.zeros(len(rows))
    result: dict[str, object] = {}
    for sensor in np.unique(rows.sensor):
        own = rows.sensor == sensor
        apart[own] = log_odds(fit(subset(rows, ~own)), rows.readings[own])
        its = subset(rows, own)
        shares = [float(reliability_at(its, odds, ODDS)) for odds in (log_odds(whole, its.readings), apart[own])]
        click.echo(f"{sensor}: right poses accepted with it {shares[0]:.3f}, left out of the fit {shares[1]:.3f}")
        result[str(sensor)] = {"fitted": shares[0], "left_out": shares[1]}
    table = reliability(rows, apart)
    show(table, f"{len(np.unique(rows.pair))} pairs, each by a fit that has not seen its sensor")
    if write:
        recordings = [path.stem for path in sorted(folder.glob("*.npz"))]
        WRITTEN.write_text(written(whole, len(np.unique(rows.pair)), recordings))
    if json_file is not None:
        json_file.write_text(json.dumps({"sensors": result, "left_out": table}, indent=1))


@main.command("check")
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path))
def check_command(folder: Path, json_file: Path | None) -> None:
    """Judge FOLDER, which must not be what was fitted to, by the weights of the package."""
    check(Rows.joined(_parts(folder)), json_file)


def check(rows: Rows, json_file: Path | None) -> None:
    """Print how true the odds of the package are of these rows."""
    table = reliability(rows, log_odds(SHIPPED, rows.readings))
    show(table, f"{len(np.unique(rows.pair))} pairs by the weights of the package")
    if json_file is not None:
        json_file.write_text(json.dumps(table, indent=1))


def subset(rows: Rows, chosen: Array) -> Rows:
    """Some of the rows."""
    return Rows(**{name: getattr(rows, name)[chosen] for name in rows.__dataclass_fields__})


def reliability_at(rows: Rows, odds: Array, least: float) -> float:
    """The share of the pairs whose best pose is right of which the gate accepts a right one."""
    right, _ = begun_summary(rows)
    return float((accepted(rows, odds, least) & right).sum() / max(1, closable(rows)))


if __name__ == "__main__":
    main()

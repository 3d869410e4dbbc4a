"""Charts of a campaign's page as SVG in the page's colours: profiles, differences, convergence, box plots, heat maps."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.cbook import boxplot_stats
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from antdrive.base.atomic import write_text
from antdrive.base.types import Flags, Floats
from antdrive.runs.statistics.convergence import HISTORY, unpacked
from antdrive.runs.statistics.pairing import PairedRuns
from antdrive.runs.statistics.success import StepCurve, distributions, performance_profiles
from antdrive.sim.log.metrics import METRICS
from antdrive.views.colours import INK, MUTED, LabelStyle, hexed
from antdrive.views.figures.canvas import PRINTED, colour_bar, new_figure, save_figure, styled
from antdrive.views.figures.paper_figures import ConvergenceCurve, draw_convergence, draw_heat_map
from antdrive.views.pages.campaign_summary import DEFAULT_METRICS, CampaignSummary, known_metrics
from antdrive.views.pages.rendering import Quantity, measure_title
from antdrive.views.pages.tables import latex_text

WORST = 10_000.0  # right end of a profile, as a multiple of the best value
WIDTH, HEIGHT = 4.7, 3.1  # of a chart [inches]
LETTERS, LEGEND_ROW = 15.0, 0.16  # letters of a legend per inch, height of a row [inches]
TITLE = 24  # characters per line above a planner's box plots
FEWEST = 3  # values per box
MOST_PANELS = 24  # planners with box plots
MOST_DOTS = 60  # outliers per box
BINS = 4  # groups of world sizes
MOST_PAIRS = 8  # pairs of planners in a chart of differences
#: Metrics of box plots by world size and option, if no others are asked for.
BOXED = ("plan_s", "gap_to_grid_optimum")
#: Columns that measure a world's size; the second is used if all areas are equal.
AREA, OPTIMUM = "area_m2", "grid_optimum_m"
#: CSS variables that replace the colours of the canvas's style.
PAGE_COLOURS = {hexed(INK): "--ink", hexed(MUTED): "--muted", "#aab2bf": "--axis", "#e6e9ee": "--line"}


class Chart(NamedTuple):
    """Chart of the page."""

    title: str  # heading
    note: str  # caption
    figure: Figure  # picture
    svg: str  # the picture as an SVG element in the page's colours


def campaign_charts(summary: CampaignSummary, styles: Sequence[LabelStyle]) -> list[Chart]:
    """Return all charts of the summary's metrics for which the campaign has data."""
    paired, charts = summary.paired, list[Chart]()
    whole = paired.counted(*range(len(paired.planners)))
    compared = known_metrics(paired, list(summary.medians))
    for name in compared if whole.any() else ():
        values = paired.values(name)[whole]
        if METRICS[name].better == "lower" and len(paired.planners) > 1 and np.nanmin(values, initial=0.0) >= 0:
            charts.append(_profile(name, performance_profiles(values), int(whole.sum()), styles))
        else:
            curves = distributions(Quantity.of(name).factor * values)
            charts.append(_distribution(name, curves, int(whole.sum()), styles))
        charts += _differences(summary, name, styles)
    charts += _convergence(paired, styles)
    usual = compared == known_metrics(paired, DEFAULT_METRICS)
    boxed = known_metrics(paired, BOXED) if usual else compared
    common = np.asarray(paired.success.all(axis=1)) & whole
    for name in boxed if common.any() else ():
        charts += _size_boxes(paired, name, common, styles)
    return [*charts, *_option_charts(paired, boxed, styles)]


def write_charts(charts: Sequence[Chart], planners: Sequence[str], folder: Path, width: float = WIDTH) -> list[Path]:
    """Write each chart as PDF and SVG of a width [inches], with the planners' names, and `figures.tex` with all captions."""
    files, lines = list[Path](), ["% antdrive report; needs \\usepackage{graphicx}"]
    for chart in charts:
        drawn = {line.get_gid(): line for axes in chart.figure.axes for line in axes.lines if line.get_gid()}
        names = [planners[int(str(key).removeprefix("planner-"))] for key in drawn]
        with styled(), matplotlib.rc_context({"legend.fontsize": 7.0}):
            columns = max(1, int(LETTERS * width / (7 + max(map(len, names), default=0))))
            if names:
                chart.figure.legend(
                    list(drawn.values()), names, loc="outside upper left", ncols=min(columns, len(names))
                )
        rows = -(-len(names) // columns) if names else 0
        chart.figure.set_size_inches(width, chart.figure.get_size_inches()[1] + LEGEND_ROW * rows)
        stem = re.sub(r"[^a-z0-9]+", "-", chart.title.lower()).strip("-")
        files += [save_figure(chart.figure, folder / f"{stem}{suffix}") for suffix in PRINTED]
        caption = latex_text(f"{chart.title}. {chart.note}")
        lines += ["", r"\begin{figure}", r"\centering", f"\\includegraphics{{{stem}}}"]
        lines += [f"\\caption{{{caption}}}", f"\\label{{fig:{stem}}}", r"\end{figure}"]
    return [*files, write_text(folder / "figures.tex", "\n".join(lines) + "\n")]


def _profile(name: str, curves: Sequence[StepCurve], count: int, styles: Sequence[LabelStyle]) -> Chart:
    def draw(axes: Any) -> None:
        largest = max((float(curve.x[-1]) for curve in curves if len(curve.x)), default=1.0)
        top = min(max(largest * 1.05, 1.1), WORST)
        _steps(axes, curves, styles, 1.0, top, log=top > 4)
        axes.set(xlabel=f"{_plain(name)}, relative to the best planner", ylabel="fraction of instances")

    note = (
        f"Fraction of {count} instances (world, task, settings, seed; repetitions once) that a planner solves within x times "
        "the best planner's value. Failures count as unsolved. Higher is better."
    )
    return _chart(f"Performance profile: {_plain(name)}", note, _drawn(draw), styles)


def _distribution(name: str, curves: Sequence[StepCurve], count: int, styles: Sequence[LabelStyle]) -> Chart:
    def draw(axes: Any) -> None:
        values = np.concatenate([curve.x for curve in curves])
        low, high = float(values.min()), float(values.max())
        log = low > 0 and high > 20 * low
        _steps(axes, curves, styles, low / 1.1 if log else 0.0, 1.05 * high or 1.0, log=log)
        axes.set(xlabel=measure_title(name), ylabel="fraction of instances")

    note = f"Fraction of {count} instances that a planner solves with at most x. Failures count as unsolved."
    return _chart(f"Distribution: {_plain(name)}", note, _drawn(draw), styles)


def _differences(summary: CampaignSummary, name: str, styles: Sequence[LabelStyle]) -> list[Chart]:
    """Return box plots of the paired differences of each pair, with the median's interval; none without pairs."""
    paired, quantity = summary.paired, Quantity.of(name)
    rows = sorted((row for row in summary.comparisons.get(name, ()) if row.pairs), key=lambda row: row.decisive_p)
    shown, labels = rows[:MOST_PAIRS], list(paired.planners)
    if not shown:
        return []
    values = quantity.factor * paired.values(name)
    ends = [(labels.index(row.first), labels.index(row.second)) for row in shown]
    gaps = [values[paired.counted(i, j), i] - values[paired.counted(i, j), j] for i, j in ends]
    gaps = [gap[np.isfinite(gap)] for gap in gaps]

    names = [f"{fill(row.first, TITLE)}\n− {fill(row.second, TITLE)}" for row in shown]
    height = 1.3 + 0.13 * sum(max(3, name.count("\n") + 2) for name in names)

    def draw(axes: Any) -> None:
        axes.axvline(0, color=hexed(INK), lw=0.8)
        for place, (row, gap) in enumerate(zip(shown, gaps, strict=True), start=1):
            box = boxplot_stats(gap)[0]
            middle = Rectangle((box["q1"], place - 0.26), box["q3"] - box["q1"], 0.52)
            middle.set(facecolor="#e6e9ee", edgecolor=hexed(MUTED), linewidth=0.9)
            axes.add_patch(middle)
            axes.hlines(
                [place, place], [box["whislo"], box["q3"]], [box["q1"], box["whishi"]], color=hexed(MUTED), lw=0.9
            )
            axes.plot(box["fliers"], np.full(len(box["fliers"]), place), "o", ms=2, mew=0, color=hexed(MUTED))
            better = labels.index(row.decided) if row.decided else -1
            colour = styles[better].light if better >= 0 else hexed(MUTED)
            low, high = (quantity.factor * end for end in row.interval)
            axes.plot([low, high], [place, place], lw=3.5, color=colour, solid_capstyle="butt", zorder=4)
            axes.plot(quantity.factor * row.difference, place, "D", ms=5, color=colour, mec="white", zorder=5)
        axes.set_yticks(range(1, len(shown) + 1), names, fontsize=7.5)
        axes.invert_yaxis()
        axes.figure.supxlabel(f"difference of {quantity.heading}", fontsize=matplotlib.rcParams["font.size"])

    better = {"lower": "below 0 the first is better", "higher": "above 0 the first is better"}
    unit = f" [{quantity.unit}]" if quantity.unit else ""
    direction = better.get(METRICS[name].better, "neither direction is better")
    rest = f" The {len(shown)} of {len(rows)} pairs with the smallest p." if len(rows) > len(shown) else ""
    pairs = _counts([len(gap) for gap in gaps], "from the top", " pairs")
    note = (
        f"First minus second planner{unit}, where both succeeded ({pairs}): "
        f"{direction}. Box: quartiles and median; whiskers: within 1.5 times the box. Diamond and bar: "
        "median and its 95 % interval, in the planner's colour if "
        f"Wilcoxon's test and the test over worlds both show a difference (Holm, 5 %).{rest}"
    )
    return [_chart(f"Paired differences: {quantity.title}", note, _drawn(draw, height), styles)]


def _counts(numbers: Sequence[int], order: str, what: str = "") -> str:
    return f"{numbers[0]}{what} each" if len({*numbers}) == 1 else f"{', '.join(map(str, numbers))}{what} {order}"


def _convergence(paired: PairedRuns, styles: Sequence[LabelStyle]) -> list[Chart]:
    """Return the best lengths so far by iteration, work and time of the planners with iterations; none without any."""
    table, shortest = paired.table, paired.table.numbers(OPTIMUM)
    plans = [text and unpacked(text) for text in table.texts(HISTORY)]
    times, spent = table.numbers("plan_s"), dict[str, list[Any]]()
    for k, label in enumerate(paired.planners):
        places = np.flatnonzero(paired.counted(k))
        rows = [row for row in paired.row[places, k].tolist() if plans[row] and shortest[row] > 0]
        if not rows:
            continue
        found = [plans[row] for row in rows]
        own: dict[str, Any] = {
            "name": label,
            "style": styles[k],
            "best": [one.best / shortest[row] for one, row in zip(found, rows, strict=True)],
            "maps": paired.world[places[np.isin(paired.row[places, k], rows)]],
            "optimum": 1.0,
        }
        efforts = (None, 1e-6 * np.array([one.work for one in found]), times[rows])
        for axis, effort in zip(("iteration", "work [million steps]", "planning time [s]"), efforts, strict=True):
            if effort is None or np.isfinite(effort).all():
                spent.setdefault(axis, []).append(ConvergenceCurve(**own, spent=effort, x=axis))
    charts = []
    for axis, curves in spent.items():

        def draw(axes: Any, curves: list[ConvergenceCurve] = curves) -> None:
            draw_convergence(axes, curves)
            axes.get_legend().remove()
            for line in axes.lines[:-1]:
                line.set_gid(f"planner-{paired.planners.index(line.get_label())}")
            axes.set_ylabel("best path so far / shortest")

        runs = _counts([len(one.best) for one in curves], "in the legend's order", " runs")
        note = (
            "Best planned path so far over the shortest on the grid: median over "
            f"{runs}, and its 95 % interval over worlds (with one world, over runs). "
            "Runs without a path count as longer than any."
        )
        if axis != "iteration":
            note += " Each run's effort is spread evenly over its iterations; work: ant steps, or rated chromosomes."
        charts.append(_chart(f"Convergence by {axis.partition(' [')[0]}", note, _drawn(draw), styles))
    return charts


def _steps(
    axes: Any, curves: Sequence[StepCurve], styles: Sequence[LabelStyle], low: float, high: float, *, log: bool
) -> None:
    for k, (curve, style) in enumerate(zip(curves, styles, strict=True)):
        inside = curve.x <= high
        share = curve.fraction[inside]
        x = np.concatenate([[low], curve.x[inside], [high]])
        share = np.concatenate([[0.0], share, share[-1:] if len(share) else [0.0]])
        (line,) = axes.step(x, share, where="post", color=style.light, ls=style.dash, lw=1.6)
        line.set_gid(f"planner-{k}")
    first = curves[0]
    if len(curves) > 1 and all(
        np.array_equal(first.x, one.x) and np.array_equal(first.fraction, one.fraction) for one in curves
    ):
        _write_identical(axes, "all planners identical")
    if log:
        axes.set_xscale("log")
        _plain_ticks(axes.xaxis, low, high)
    axes.set(xlim=(low, high), ylim=(-0.02, 1.02))


def _write_identical(axes: Any, words: str) -> None:
    size = 0.9 * matplotlib.rcParams["font.size"]
    axes.text(0.5, 0.97, words, ha="center", va="top", transform=axes.transAxes, fontsize=size)


def _size_boxes(paired: PairedRuns, name: str, common: Flags, styles: Sequence[LabelStyle]) -> list[Chart]:
    """Return box plots by world size, a panel per planner, over instances that all planners solved."""
    for column in (AREA, OPTIMUM):
        known = np.nan_to_num(paired.table.numbers(column), nan=-np.inf)
        sizes = np.where(paired.row >= 0, known[paired.row], -np.inf).max(axis=1)
        edges = _edges(sizes[common & np.isfinite(sizes)])
        if len(edges) > 2:
            break
    else:
        return []
    common = common & np.isfinite(sizes)
    group = np.clip(np.searchsorted(edges, sizes, side="right") - 1, 0, len(edges) - 2)
    values = _values(paired, name)
    groups = [[values[common & (group == g), k] for g in range(len(edges) - 1)] for k in range(len(paired.planners))]
    exact = edges[-1] == edges[-2]
    labels = [_round(edge) for edge in edges[:-1]] if exact else [f"≤{_round(edge)}" for edge in edges[1:]]
    counts = _counts([int((common & (group == g)).sum()) for g in range(len(labels))], "from left to right")
    size = "area of the world [m²]" if column == AREA else "shortest path on the grid [m]"
    title = measure_title(name)
    note = (
        f"{title[:1].upper()}{title[1:]} by {size}, on the {int(common.sum())} instances that every planner solved ({counts}). "
        "Box: quartiles and median; whiskers: within 1.5 times the box; dots: outliers."
    )
    figure = _panels(groups, labels, list(paired.planners), styles, name, size)
    return [_chart(f"By world size: {_plain(name)}", note, figure, styles)]


def _edges(sizes: Floats) -> Floats:
    """Return the edges of up to `BINS` groups: the distinct sizes with the last one repeated, or quantiles if there are more."""
    distinct = np.unique(sizes)
    if len(distinct) < 2:
        return distinct
    if len(distinct) <= BINS:
        return np.append(distinct, distinct[-1])  # one group per size
    inner = np.unique(np.quantile(sizes, np.linspace(0, 1, BINS + 1)))
    return np.asarray(inner)


def _option_charts(paired: PairedRuns, metrics: Sequence[str], styles: Sequence[LabelStyle]) -> list[Chart]:
    """Return box plots of each planner with one option of several values, and heat maps of those with two."""
    table, charts = paired.table, list[Chart]()
    first = paired.row.max(axis=0)  # one row per planner
    names = np.array(table.texts("planner_name"), dtype=object)[first]
    texts = {
        name: np.array(table.texts(name), dtype=object)[first] for name in table.columns if name.startswith("option.")
    }
    for planner in dict.fromkeys(names):
        mine = [k for k in range(len(names)) if names[k] == planner]
        varied = [name for name in sorted(texts) if len(set(texts[name][mine])) > 1]
        if len(varied) == 1:
            mine.sort(key=lambda k: _natural(str(texts[varied[0]][k])))
            charts += _boxes_of_option(paired, planner, varied[0], mine, list(texts[varied[0]][mine]), metrics, styles)
        elif len(varied) == 2:
            charts += _heat_maps(
                paired, planner, {name: list(texts[name][mine]) for name in varied}, mine, metrics, styles
            )
    return charts


def _heat_maps(
    paired: PairedRuns,
    planner: str,
    options: Mapping[str, list[str]],
    mine: list[int],
    metrics: Sequence[str],
    styles: Sequence[LabelStyle],
) -> list[Chart]:
    """Return a heat map over two options of the success rate, if it varies, and of the median of each metric."""
    (down, along), (rows, columns) = options, (sorted(set(values), key=_natural) for values in options.values())
    places = [(rows.index(a), columns.index(b)) for a, b in zip(*options.values(), strict=True)]
    counted = paired.counted(*mine)
    common = paired.success[:, mine].all(axis=1) & counted
    shares = 100 * paired.success[counted][:, mine].mean(axis=0) if counted.any() else np.zeros(0)
    found = [("success [%]", "success", shares, f"{int(counted.sum())} instances")] if len(set(shares)) > 1 else []
    for name in metrics if common.any() else ():
        where = f"the {int(common.sum())} instances solved with all values"
        medians = np.median(_values(paired, name)[common][:, mine], axis=0)
        found.append((measure_title(name), f"median {_plain(name)}", medians, where))
    charts, named = [], [name.removeprefix("option.") for name in (down, along)]
    for heading, title, values, where in found:
        cells = np.full((len(rows), len(columns)), np.nan)
        for place, value in zip(places, values.tolist(), strict=True):
            cells[place] = value

        def draw(axes: Any, cells: Floats = cells, heading: str = heading) -> None:
            drawn = draw_heat_map(axes, cells, rows, columns, (float(np.nanmin(cells)), float(np.nanmax(cells))))
            axes.set(xlabel=named[1], ylabel=named[0])
            colour_bar(axes.figure, drawn, axes, heading, shrink=0.9, aspect=24)

        by = f"by {named[0]} and {named[1]}"
        note = f"{title[0].upper()}{title[1:]} of {planner} {by}, over {where}."
        charts.append(_chart(f"{planner} {by}: {title}", note, _drawn(draw), styles))
    return charts


def _boxes_of_option(
    paired: PairedRuns,
    planner: str,
    column: str,
    mine: list[int],
    values: list[str],
    metrics: Sequence[str],
    styles: Sequence[LabelStyle],
) -> list[Chart]:
    option = column.removeprefix("option.")
    common = paired.success[:, mine].all(axis=1) & paired.counted(*mine)
    charts = []
    for name in metrics if common.sum() >= FEWEST else ():
        boxes = [_values(paired, name)[common, k] for k in mine]

        def draw(axes: Any, name: str = name, boxes: list[Floats] = boxes) -> None:
            _draw_boxes(axes, boxes, [styles[k].light for k in mine])
            if all(np.array_equal(boxes[0], box) for box in boxes):
                _write_identical(axes, f"identical for every {option}")
            axes.set(xlabel=option, ylabel=measure_title(name))
            axes.set_xticks(range(1, len(values) + 1), values)
            _value_scale(axes, np.concatenate(boxes))

        note = f"{measure_title(name)} of {planner} on the {int(common.sum())} instances solved with every {option}."
        charts.append(_chart(f"{planner} by {option}: {_plain(name)}", note, _drawn(draw), styles))
    return charts


def _panels(
    groups: list[list[Floats]],
    labels: list[str],
    planners: list[str],
    styles: Sequence[LabelStyle],
    name: str,
    size: str,
) -> Figure:
    """Return a small box plot per planner, all with the same axes."""
    shown = min(len(planners), MOST_PANELS)
    columns = min(3, shown)
    rows = math.ceil(shown / columns)
    with styled(), matplotlib.rc_context({"font.size": 7.5}):
        figure = new_figure(WIDTH, 0.6 + 1.15 * rows)
        figure.set_facecolor("none")
        grid: Any = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for k, axes in enumerate(grid.flat):
            axes.set_facecolor("none")
            if k >= shown:
                axes.set_visible(False)
                continue
            _draw_boxes(axes, groups[k], [styles[k].light] * len(labels))
            axes.set_title(fill(planners[k], TITLE), fontsize=7.5, weight="normal", color=styles[k].light)
            same = next(j for j in range(k + 1) if all(map(np.array_equal, groups[j], groups[k])))
            if same < k:
                _write_identical(axes, fill(f"identical to {planners[same]}", TITLE))
        everything = np.concatenate([np.concatenate(group) for group in groups[:shown]])
        _value_scale(grid.flat[0], everything, steps=(1, 3))
        for k, axes in enumerate(grid.flat[:shown]):
            axes.set_xticks(range(1, len(labels) + 1), labels)
            axes.tick_params(
                axis="x", labelsize=6, labelrotation=40 if len(labels) > 2 else 0, labelbottom=k + columns >= shown
            )
        figure.supxlabel(size, fontsize=8)
        figure.supylabel(measure_title(name), fontsize=8)
        return figure


def _draw_boxes(axes: Any, groups: Sequence[Floats], colours: Sequence[str]) -> None:
    """Draw a box for each group at 1, 2, ...; the values themselves if they are few."""
    for place, (values, colour) in enumerate(zip(groups, colours, strict=True), start=1):
        if len(values) < FEWEST:
            axes.plot(np.full(len(values), place), values, "o", ms=3, color=colour)
            continue
        facts = boxplot_stats(values)[0]
        far = np.sort(facts["fliers"])
        facts["fliers"] = far[np.unique(np.linspace(0, len(far) - 1, MOST_DOTS).astype(int))] if len(far) else far
        line = {"color": colour, "lw": 1.2}
        dots = {"marker": "o", "ms": 1.8, "mec": "none", "mfc": colour, "alpha": 0.6}
        axes.bxp(
            [facts], positions=[place], widths=0.55, manage_ticks=False, boxprops=line, whiskerprops=line,
            capprops=line, medianprops={"color": colour, "lw": 2.4}, flierprops=dots,
        )  # fmt: skip
    axes.set_xlim(0.4, len(groups) + 0.6)


def _value_scale(axes: Any, values: Floats, steps: tuple[float, ...] = ()) -> None:
    """Set a logarithmic axis if the values span more than a factor of 20; `steps`: ticks per decade."""
    low, high = float(values.min()), float(values.max())
    if low > 0 and high > 20 * low:
        axes.set_yscale("log")
        _plain_ticks(axes.yaxis, low, high, steps)


def _plain_ticks(axis: Any, low: float, high: float, steps: tuple[float, ...] = ()) -> None:
    """Label the ticks of a logarithmic axis with plain numbers."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    decades = math.log10(high / low)
    steps = steps or ((1,) if decades > 4 else (1, 3) if decades > 1.5 else (1, 1.5, 2, 3, 5, 7))
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ticks = [step * 10.0**power for power in powers for step in steps]
    axis.set_major_locator(FixedLocator([tick for tick in ticks if low * 0.999 <= tick <= high * 1.001]))
    axis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:.6g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _chart(title: str, note: str, figure: Figure, styles: Sequence[LabelStyle]) -> Chart:
    with styled(), matplotlib.rc_context({"svg.fonttype": "none"}):
        return Chart(title, note, figure, _svg(figure, styles))


def _drawn(draw: Any, height: float = HEIGHT) -> Figure:
    with styled():
        figure = new_figure(WIDTH, height)
        figure.set_facecolor("none")
        axes: Any = figure.add_subplot()
        axes.set_facecolor("none")
        draw(axes)
        return figure


def _svg(figure: Figure, styles: Sequence[LabelStyle]) -> str:
    """Return a figure as an SVG element without a fixed size, in the page's colour variables."""
    content = io.StringIO()
    figure.savefig(content, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
    text = content.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r' id="planner-(\d+)"', r' class="planner-\1"', text)
    text = re.sub(r' id="[\w.]+_\d+"', "", text)  # ids would repeat in every chart
    colours = {style.light: f"--planner-{k}" for k, style in enumerate(styles)} | PAGE_COLOURS
    return re.sub("#[0-9a-f]{6}", lambda match: f"var({colours[match[0]]})" if match[0] in colours else match[0], text)


def _values(paired: PairedRuns, name: str) -> Floats:
    """Return a metric's values in the unit of its title."""
    return Quantity.of(name).factor * paired.values(name)


def _plain(name: str) -> str:
    return Quantity.of(name).title


def _round(value: float) -> str:
    return f"{value:.3g}"


def _natural(text: str) -> tuple[int, float, str]:
    """Return a key that sorts numbers by value and before other texts."""
    try:
        return 0, float(text), text
    except ValueError:
        return 1, 0.0, text

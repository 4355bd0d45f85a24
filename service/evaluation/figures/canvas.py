"""One picture: axes with named units, drawn without a display, the same bytes for the same numbers."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from service.errors import ParameterError

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

WIDTH_INCH: Final = 9.0
HEIGHT_INCH: Final = 4.0
DPI: Final = 110
COLOURS: Final = ("#1b6ca8", "#d1495b", "#66a182", "#edae49", "#8d6a9f", "#4a4e69", "#00798c", "#a98467")
"""Told apart by the colour-blind in this order; a figure takes as many as it has series."""
MISSING: Final = "matplotlib is missing: pip install 'steplink[figures]'"

Draw = Callable[["list[Axes]"], None]


def checked_folder(folder: str) -> Path:
    """Return the folder to draw into, made if need be; ParameterError where that or matplotlib is impossible."""
    if importlib.util.find_spec("matplotlib") is None:
        raise ParameterError("figures", folder, MISSING)
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ParameterError("figures", folder, f"no folder can be made there: {error.strerror}") from error
    return path


def picture(path: Path, draw: Draw, *, panels: int = 1, share_x: bool = True, share_y: bool = False) -> Path:
    """Draw `panels` axes one below the other with `draw` and write them to `path`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  # heavy, and an extra
    from matplotlib.figure import Figure  # noqa: PLC0415

    height = HEIGHT_INCH if panels == 1 else 1.9 * panels + 0.8
    figure = Figure(figsize=(WIDTH_INCH, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(panels, 1, sharex=share_x, sharey=share_y, squeeze=False)[:, 0]
    draw(list(axes))
    for each in axes:
        each.grid(visible=True, alpha=0.3)
        each.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    return path


def label(
    axes: Axes,
    *,
    title: str = "",
    x: str = "",
    y: str = "",
    legend: bool = False,
    columns: int = 5,
    handles: Sequence[Artist] | None = None,
) -> None:
    """Name what the axes show, units included; `handles` stand in the legend instead of what the axes hold."""
    axes.set(**{name: text for name, text in (("xlabel", x), ("ylabel", y)) if text})
    figure = axes.get_figure(root=True)
    if title and figure is not None:
        figure.suptitle(title)
    if legend:  # above the axes, where it hides nothing
        shown = axes.get_legend_handles_labels()[0] if handles is None else handles
        axes.legend(
            handles=shown, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, fontsize="small", frameon=False
        )

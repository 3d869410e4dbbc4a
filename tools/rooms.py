"""Picture of the packages and their imports: `python -m tools.rooms` writes `docs/pictures/rooms.svg`."""

from __future__ import annotations

import ast
import re
import sys
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "antdrive"
PICTURE = ROOT / "docs" / "pictures" / "rooms.svg"
ROWS = (
    ("cli",),
    ("testing", "gym"),
    ("views",),
    ("runs",),
    ("foreign",),
    ("sim",),
    ("proof",),
    ("planners", "robots"),
    ("worlds",),
    ("base",),
)  # from the top
WIDTH, HEIGHT, BOX, STEP, LEFT = 760, 668, 44, 66, 20  # [px]


def imports() -> dict[str, set[str]]:
    """Return the other rooms that each room imports."""
    found: dict[str, set[str]] = {room: set() for row in ROWS for room in row}
    for room, others in found.items():
        for path in (SOURCE / room).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom | ast.Import):
                    names = (
                        [node.module or ""] if isinstance(node, ast.ImportFrom) else [one.name for one in node.names]
                    )
                    others |= {*re.findall(r"^antdrive\.(\w+)", "\n".join(names), re.MULTILINE)} & {*found} - {room}
    return found


def drawn() -> str:
    """Return the picture as SVG: a box for each room with its summary, and the rooms that it imports."""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    imported = imports()
    for i, row in enumerate(ROWS):
        width = (WIDTH - 2 * LEFT - 16 * (len(row) - 1)) / len(row)
        for j, room in enumerate(row):
            x, y = LEFT + j * (width + 16), 6 + i * STEP
            text = ast.get_docstring(ast.parse((SOURCE / room / "__init__.py").read_text(encoding="utf-8"))) or ""
            said = text.partition("\n")[0].partition(": ")
            summary = escape((said[2] or said[0]).rstrip(".")[: 112 // len(row)])
            uses = ", ".join(other for row in ROWS for other in row if other in imported[room]) or "nothing"
            lines += [
                f'<rect x="{x:g}" y="{y}" width="{width:g}" height="{BOX}" rx="6" fill="#eef2f7" stroke="#5a6577"/>',
                f'<text x="{x + 12:g}" y="{y + 19}" font-size="15" font-weight="bold" fill="#1c2430">{room}</text>',
                f'<text x="{x + width - 12:g}" y="{y + 19}" font-size="11" text-anchor="end" fill="#5a6577">'
                f"imports {uses}</text>",
                f'<text x="{x + 12:g}" y="{y + 36}" font-size="12" fill="#1c2430">{summary}</text>',
            ]
            if i + 1 < len(ROWS):
                middle = x + width / 2
                lines.append(
                    f'<path d="M {middle:g} {y + BOX} v {STEP - BOX - 7} m -5 -6 l 5 6 l 5 -6" fill="none" '
                    'stroke="#5a6577" stroke-width="2"/>'
                )
    return "\n".join([*lines, "</svg>", ""])


def main() -> int:
    """Write the picture."""
    PICTURE.write_text(drawn(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

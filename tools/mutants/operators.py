"""Mutation operators for Python source files, each a replacement of one piece of text."""

from __future__ import annotations

import ast
import bisect
import contextlib
import re
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass

COMPARISONS = {
    "<": ("<=", ">="),
    "<=": ("<", ">"),
    ">": (">=", "<="),
    ">=": (">", "<"),
    "==": ("!=",),
    "!=": ("==",),
    "is not": ("is",),
    "is": ("is not",),
    "not in": ("in",),
    "in": ("not in",),
}
ARITHMETIC = {"+": "-", "-": "+", "*": "/", "/": "*", "//": "*", "%": "*", "**": "*", "<<": ">>", ">>": "<<"}
SYMBOLS: dict[type[ast.AST], str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.Is: "is",
    ast.IsNot: "is not", ast.In: "in", ast.NotIn: "not in", ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/",
    ast.FloorDiv: "//", ast.Mod: "%", ast.Pow: "**", ast.LShift: "<<", ast.RShift: ">>", ast.BitAnd: "&", ast.BitOr: "|",
}  # fmt: skip
OPPOSITE = {
    "min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "argmin": "argmax", "argmax": "argmin",
    "any": "all", "all": "any", "floor": "ceil", "ceil": "floor", "cos": "sin", "sin": "cos",
}  # fmt: skip
PLAIN = (ast.Name, ast.Constant, ast.Call, ast.Attribute, ast.Subscript, ast.Tuple, ast.List)


@dataclass(frozen=True)
class Mutant:
    """A mutant: one fault in one file.

    Attributes:
        file: the file, relative to the root of the project
        operator: the kind of fault, or the name of one that was written by hand
        function: the function that holds it, with its class; empty at the top of the file
        line: the first line that is changed, from 1
        was: the lines as they were, joined
        now: the lines as they are, joined
        source: the whole text of the changed file
    """

    file: str
    operator: str
    function: str
    line: int
    was: str
    now: str
    source: str

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Return a key of the fault that does not depend on line numbers."""
        return self.file, self.function, self.was, self.now


@dataclass(frozen=True)
class Edit:
    """A replacement of some bytes of a source.

    Attributes:
        operator: the kind of fault
        start: the first byte to replace
        end: the byte after the last
        text: what replaces them
    """

    operator: str
    start: int
    end: int
    text: str


def mutants_of(file: str, source: str, functions: Container[str] | None = None) -> list[Mutant]:
    """Return every distinct mutant of a file, in text order.

    Args:
        file: the file, relative to the root of the project
        source: its text
        functions: the functions whose mutants are wanted, by default all
    """
    tree = ast.parse(source)
    finder = _Finder(source)
    finder.visit(tree)
    data = source.encode()
    ends = [finder.end(statement) for statement in tree.body]
    begins = [0, *ends]
    found: dict[str, Mutant] = {}
    for function, edit in finder.found:
        if functions is not None and function not in functions:
            continue
        text = (data[: edit.start] + edit.text.encode() + data[edit.end :]).decode()
        if text == source or text in found:
            continue
        at = bisect.bisect_left(ends, edit.end)  # only this statement of the file changes
        with contextlib.suppress(SyntaxError):
            ast.parse(data[begins[at] : edit.start] + edit.text.encode() + data[edit.end : ends[at]])
            found[text] = described(file, edit.operator, function, source, text)
    return list(found.values())


def described(file: str, operator: str, function: str, source: str, text: str) -> Mutant:
    """Return the mutant that turns `source` into `text`, with the differing lines."""
    before, after = source.splitlines(), text.splitlines()
    shorter = min(len(before), len(after))
    first = next((i for i in range(shorter) if before[i] != after[i]), shorter)
    last = next((i for i in range(shorter - first) if before[-1 - i] != after[-1 - i]), shorter - first)
    was = " ".join(line.strip() for line in before[first : len(before) - last])
    now = " ".join(line.strip() for line in after[first : len(after) - last])
    return Mutant(file, operator, function, first + 1, was, now, text)


class _Finder(ast.NodeVisitor):
    """Collector of a source's edits and their functions."""

    def __init__(self, source: str) -> None:
        self.found: list[tuple[str, Edit]] = []
        self._data = source.encode()
        self._lines = [0]
        for line in self._data.splitlines(keepends=True):
            self._lines.append(self._lines[-1] + len(line))
        self._scope: list[str] = []

    def end(self, statement: ast.stmt) -> int:
        """Return the offset of the byte after a statement."""
        return self._place(statement)[1]

    def visit(self, node: ast.AST) -> None:
        if isinstance(node, ast.JoinedStr | ast.Assert | ast.Import | ast.ImportFrom | ast.arg):
            return
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            return
        self.found += [(".".join(self._scope), edit) for edit in self._edits(node)]
        if isinstance(node, ast.Raise):
            return
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            self._scope.append(node.name)
            inside: Iterable[ast.AST] = [*getattr(getattr(node, "args", None), "kw_defaults", []), *node.body]
            if isinstance(node, ast.FunctionDef):
                inside = [*node.args.defaults, *inside]
            for child in inside:
                if child is not None:
                    self.visit(child)
            self._scope.pop()
        elif isinstance(node, ast.AnnAssign):
            if node.value is not None:
                self.visit(node.value)
        else:
            self.generic_visit(node)

    def _edits(self, node: ast.AST) -> Iterator[Edit]:
        if isinstance(node, ast.Compare):
            yield from self._comparisons(node)
        elif isinstance(node, ast.BinOp):
            yield from self._arithmetic(node)
        elif isinstance(node, ast.BoolOp):
            yield from self._logic(node)
        elif isinstance(node, ast.Constant):
            yield from self._constant(node)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
            yield self._replace("sign dropped", node, self._wrapped(node.operand))
        elif isinstance(node, ast.Call):
            yield from self._call(node)
        elif isinstance(node, ast.If | ast.IfExp):
            yield self._replace("condition negated", node.test, f"not ({self._text(node.test)})")
            if isinstance(node, ast.If):
                yield self._replace("guard removed", node.test, "False")
        elif isinstance(node, ast.List | ast.Tuple) and isinstance(node.ctx, ast.Load):
            starred = [item for item in node.elts if isinstance(item, ast.Starred)]
            yield from (self._replace("element dropped", item, "*()") for item in starred)
        elif self._deletable(node):
            yield self._replace("statement deleted", node, "pass")
        if isinstance(node, ast.AugAssign):
            yield from self._swapped("arithmetic", node.target, node.value, node.op, suffix="=")

    def _comparisons(self, node: ast.Compare) -> Iterator[Edit]:
        left = node.left
        for op, right in zip(node.ops, node.comparators, strict=True):
            symbol = SYMBOLS[type(op)]
            for other in COMPARISONS[symbol]:
                yield self._between("comparison", left, right, symbol, other)
            left = right

    def _arithmetic(self, node: ast.BinOp) -> Iterator[Edit]:
        yield from self._swapped("arithmetic", node.left, node.right, node.op)
        if isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div | ast.BitAnd | ast.BitOr):
            yield self._replace("term dropped", node, self._wrapped(node.left))
        if isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.BitAnd | ast.BitOr):
            yield self._replace("term dropped", node, self._wrapped(node.right))

    def _swapped(self, name: str, left: ast.AST, right: ast.AST, op: ast.AST, suffix: str = "") -> Iterator[Edit]:
        symbol = SYMBOLS.get(type(op), "")
        if symbol in ARITHMETIC:
            yield self._between(name, left, right, symbol + suffix, ARITHMETIC[symbol] + suffix)

    def _logic(self, node: ast.BoolOp) -> Iterator[Edit]:
        symbol, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            yield self._between("logic", left, right, symbol, other)
        neutral = "True" if symbol == "and" else "False"
        for value in node.values:
            yield self._replace("condition dropped", value, neutral)

    def _constant(self, node: ast.Constant) -> Iterator[Edit]:
        value = node.value
        if isinstance(value, bool):
            yield self._replace("constant", node, str(not value))
        elif isinstance(value, int):
            yield self._replace("constant", node, str(value + 1))
            if value >= 3:
                yield self._replace("constant", node, str(value * 10))
        elif isinstance(value, float):
            for other in (value * 10, value / 10) if value else (1.0,):
                yield self._replace("constant", node, repr(other))

    def _call(self, node: ast.Call) -> Iterator[Edit]:
        name = node.func
        if isinstance(name, ast.Attribute) and name.attr in OPPOSITE:
            end = self._place(name)[1]
            yield Edit("opposite function", end - len(name.attr), end, OPPOSITE[name.attr])
        elif isinstance(name, ast.Name) and name.id in OPPOSITE:
            yield self._replace("opposite function", name, OPPOSITE[name.id])
        if isinstance(name, ast.Name | ast.Attribute) and ast.unparse(name) in ("abs", "np.abs", "min", "max"):
            yield from (self._replace("argument alone", node, self._wrapped(argument)) for argument in node.args)

    @staticmethod
    def _deletable(node: ast.AST) -> bool:
        """Return whether removing a statement leaves all names defined."""
        if isinstance(node, ast.Expr):
            return not isinstance(node.value, ast.Constant)
        if isinstance(node, ast.Assign):
            return all(isinstance(target, ast.Subscript | ast.Attribute) for target in node.targets)
        return isinstance(node, ast.AugAssign | ast.Continue | ast.Break | ast.Raise)

    def _place(self, node: ast.AST) -> tuple[int, int]:
        first = self._lines[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]
        last = self._lines[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]
        return first, last

    def _text(self, node: ast.AST) -> str:
        start, end = self._place(node)
        return self._data[start:end].decode()

    def _wrapped(self, node: ast.AST) -> str:
        return self._text(node) if isinstance(node, PLAIN) else f"({self._text(node)})"

    def _replace(self, operator: str, node: ast.AST, text: str) -> Edit:
        return Edit(operator, *self._place(node), text)

    def _between(self, operator: str, left: ast.AST, right: ast.AST, symbol: str, other: str) -> Edit:
        """Replace the operator between two operands, with parentheses and comments around it."""
        start, end = self._place(left)[1], self._place(right)[0]
        gap = self._data[start:end].decode()
        word = re.escape(symbol).replace(r"\ ", r"\s+")
        match = re.search(rf"\b{word}\b" if symbol.isalpha() or " " in symbol else word, gap)
        assert match is not None
        first = start + len(gap[: match.start()].encode())
        return Edit(operator, first, first + len(match.group().encode()), other)

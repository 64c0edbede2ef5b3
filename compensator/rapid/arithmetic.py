"""Arithmetic of numbers and constants, as far as the text settles it: + - * / DIV MOD and parentheses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from compensator.rapid.lexer import Token

# No expression of a program nests deeper.
DEEPEST = 40


@dataclass(slots=True)
class _Reading:
    """Where the evaluation stands among the tokens. named: the value of a constant, None where there is none."""

    tokens: list[Token]
    named: Callable[[Token], float | None]
    at: int = 0
    depth: int = 0

    def accept(self, *words: str) -> str:
        word = self.tokens[self.at].word
        if word in words:
            self.at += 1
            return word
        return ""


class _Open(Exception):
    """The text does not settle the value."""


def arithmetic(tokens: list[Token], named: Callable[[Token], float | None]) -> float | None:
    """The value of an expression, tokens up to one of kind "end"; None where the text does not settle it. named: the value of
    a name, None where it is no constant."""
    reading = _Reading(tokens, named)
    try:
        value = _sum(reading)
    except (_Open, ZeroDivisionError, OverflowError):
        return None
    return value if tokens[reading.at].kind == "end" and math.isfinite(value) else None


def _sum(reading: _Reading) -> float:
    reading.depth += 1
    if reading.depth > DEEPEST:
        raise _Open
    value = _product(reading)
    while sign := reading.accept("+", "-"):
        value += _product(reading) if sign == "+" else -_product(reading)
    reading.depth -= 1
    return value


def _product(reading: _Reading) -> float:
    value = _factor(reading)
    while sign := reading.accept("*", "/", "div", "mod"):
        by = _factor(reading)
        value = value * by if sign == "*" else value / by if sign == "/" else _of_whole(sign, value, by)
    return value


def _of_whole(sign: str, value: float, by: float) -> float:
    """DIV and MOD, of whole numbers that are not negative alone: of others the controllers' answers differ."""
    if value < 0 or by < 0 or not (value.is_integer() and by.is_integer()):
        raise _Open
    return value // by if sign == "div" else value % by


def _factor(reading: _Reading) -> float:
    sign = -1.0 if reading.accept("+", "-") == "-" else 1.0
    token = reading.tokens[reading.at]
    reading.at += token.kind != "end"
    if token.kind == "number":
        return sign * float(token.text)
    if token.kind == "name":
        value = reading.named(token)
        if value is None or reading.tokens[reading.at].word in ("(", ".", "{"):
            raise _Open
        return sign * value
    if token.word == "(":
        value = _sum(reading)
        if reading.accept(")"):
            return sign * value
    raise _Open

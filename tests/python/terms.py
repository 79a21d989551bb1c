"""Terms as model files have them, for arms whose flaws a test knows."""

from __future__ import annotations

CONSTANT = '{ of = "nothing", shape = "one" }'


def term(name: str, effect: str, value: float, unit: str, site: str, basis: str = CONSTANT) -> str:
    """A [[term]] table; site and basis are inline tables."""
    head = f'[[term]]\nname = "{name}"\neffect = "{effect}"\nvalue = {float(value)!r}\nunit = "{unit}"\n'
    return f"{head}site = {site}\nbasis = {basis}\n\n"


def joint(n: int) -> str:
    """The site of a joint, from 1."""
    return f"{{ joint = {{ joint = {n} }} }}"


def link(n: int, parameter: str) -> str:
    """The site of a parameter of a link."""
    return f'{{ link = {{ link = {n}, parameter = "{parameter}" }} }}'


def lost_motion(n: int, deg: float) -> str:
    """A joint that stops short, by the sense of its last motion."""
    basis = f'{{ of = "nothing", shape = "one", sense = {n} }}'
    return term(f"gap_{n}", "lost_motion_direction", deg, "deg", joint(n), basis)


def compliance(n: int, deg_per_nm: float) -> str:
    """A joint that gives way to gravity."""
    basis = f'{{ of = {{ moment = {{ joint = {n}, axis = "z" }} }}, shape = "linear" }}'
    return term(f"c_{n}", "compliance", deg_per_nm, "deg/Nm", joint(n), basis)

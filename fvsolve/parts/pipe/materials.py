"""Pipe materials: moduli, roughness and density, each with its source (data/pipe_materials.toml).

Numbers without a source are left out; the user gives them. Of several sources, the greatest modulus is used (fastest
wave, greatest pressure jump), and the mean of least and greatest value of roughness and all other properties.
"""

import functools
from dataclasses import dataclass, field

from fvsolve.data import read_table

SI = {"youngs_modulus": 1e9, "poisson_ratio": 1.0, "roughness": 1e-3, "density": 1.0}
UNITS = {"youngs_modulus": " GPa", "poisson_ratio": "", "roughness": " mm", "density": " kg/m3"}
WITHOUT_SOURCE = ("PVC-O", "PEX", "hydraulic-hose")  # pipe materials without a source for their figures


@dataclass(frozen=True)
class Figure:
    """Property of a material, such as its density, in SI: least and greatest value in its sources, and the value used.

    key : name of the property; sources : keys of `sources()`
    """

    key: str
    least: float
    greatest: float
    sources: tuple[str, ...]
    material_form: str = ""  # form of the material in the source

    @property
    def used(self) -> float:
        return self.greatest if self.key == "youngs_modulus" else 0.5 * (self.least + self.greatest)

    def span(self, between: str) -> str:
        """Text of the least and greatest value in the unit of the catalogue; between : text between both

        It is a single number if both are equal.
        """
        low, high = (f"{x / SI[self.key]:.4g}" for x in (self.least, self.greatest))
        return low if low == high else f"{low}{between}{high}"

    @property
    def description(self) -> str:
        """Text with the value used, its range and its sources."""
        choice = "the greatest" if self.key == "youngs_modulus" else "the mean"
        span = "" if self.least == self.greatest else f", {choice} of {self.span(' to ')}"
        form = f" ({self.material_form})" if self.material_form else ""
        texts = "; ".join(sources()[key] for key in self.sources)
        return f"{self.key.replace('_', ' ')} {self.used / SI[self.key]:.4g}{UNITS[self.key]}{span}{form}: {texts}"


@dataclass(frozen=True)
class Material:
    """Material of the catalogue; figures : key of a property -> its values (`Figure`)."""

    name: str
    figures: dict[str, Figure] = field(default_factory=dict)

    @property
    def missing_keys(self) -> list[str]:
        """Keys of the properties for which there is no source."""
        return [key for key in SI if key not in self.figures]


@functools.cache
def materials() -> dict[str, Material]:
    """Catalogue of materials: name -> material."""
    catalogue: dict[str, Material] = {}
    for name, figures in read_table("pipe_materials")["materials"].items():
        catalogue[name] = Material(name)
        for key, (least, greatest, source, *form) in figures.items():
            bounds = least * SI[key], greatest * SI[key]
            catalogue[name].figures[key] = Figure(key, *bounds, tuple(source.split(", ")), *form)
    return catalogue


def sources() -> dict[str, str]:
    """Sources of the properties of materials : key -> text."""
    return read_table("pipe_materials")["sources"]

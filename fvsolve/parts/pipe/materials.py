"""Pipe materials: moduli, roughness and density, each with its source.

Numbers without a source are left out; the user gives them. Of several sources, the greatest modulus is used (fastest
wave, greatest pressure jump), and the mean of least and greatest value of roughness and all other properties.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field

SOURCES = {
    "maff": "MAFF (Japan), Pipeline design manual 2021, table 8.2.1, as in open-waterhammer's check of 2026-03-28",
    "staad": "EN 1993-1 in the help of STAAD.Pro 2026, D5.A.3",
    "elmer": "Elmer's materials, egmaterials.xml",
    "idelchik": "Idelchik, Handbook of Hydraulic Resistance, 4th ed., as in fluids.friction",
    "aquaflo": "Aquaflo, Ductile iron pipe, properties",
    "doran": "Doran, Newnes Construction Materials Pocket Book 1994, 100 s at 1 % strain, as in maintainability.com.sg",
    "firat": "Firat, PE pipe technical informations, ISO 527 and ISO 1183, least values",
    "pe100plus": "PE100+ Association, PE100 pipe properties and types",
    "adpf": "ADPF, properties of FRP pipes, ASTM D2290",
}

# least, greatest and source of each: youngs_modulus [GPa], poisson_ratio [-], roughness [mm], density [kg/m3]
TABLE = """
steel                 E    200    205    maff, staad, elmer
steel                 nu   0.285  0.3    elmer, staad
steel                 k    0.04   0.1    idelchik         welded steel tubes, good condition
steel                 rho  7831   7850   staad, elmer
stainless-steel       E    200    200    elmer
stainless-steel       nu   0.285  0.285  elmer
stainless-steel       rho  7925   7925   elmer
hydraulic-tube        E    200    205    maff, staad, elmer
hydraulic-tube        nu   0.285  0.3    elmer, staad
hydraulic-tube        k    0.02   0.1    idelchik         seamless steel tubes, new and unused
hydraulic-tube        rho  7831   7850   staad, elmer
ductile-iron          E    160    166.7  maff, aquaflo
ductile-iron          k    0.1    0.15   idelchik         cast-iron tubes, new, bituminized
ductile-iron          rho  7050   7050   aquaflo
concrete              E    20     20     maff             centrifugal, reinforced
concrete              k    0.25   0.34   idelchik         reinforced concrete tubes, new
prestressed-concrete  E    39     39     maff             with a core
copper                E    115    115    elmer
copper                nu   0.34   0.34   elmer
copper                k    0.0015 0.01   idelchik         seamless tubes of copper, commercially smooth
copper                rho  8960   8960   elmer
PVC-U                 E    2.7    3.1    doran, maff, elmer
PVC-U                 nu   0.41   0.41   elmer
PVC-U                 rho  1380   1450   doran, elmer
PE80                  E    0.7    0.7    firat
PE80                  rho  950    950    firat
PE100                 E    1.0    1.3    firat, maff
PE100                 nu   0.45   0.45   pe100plus
PE100                 k    0.00152 0.00152 pe100plus      of Colebrook and White
PE100                 rho  950    950    firat
GRP                   E    14.7   24     maff, adpf       filament wound, along the hoop
GRP                   k    0.0015 0.04   adpf             without joints, with them
GRP                   rho  1800   1800   adpf
"""

KEYS = {"E": "youngs_modulus", "nu": "poisson_ratio", "k": "roughness", "rho": "density"}
SI = {"youngs_modulus": 1e9, "poisson_ratio": 1.0, "roughness": 1e-3, "density": 1.0}
UNITS = {"youngs_modulus": " GPa", "poisson_ratio": "", "roughness": " mm", "density": " kg/m3"}
WITHOUT_SOURCE = ("PVC-O", "PEX", "hydraulic-hose")  # pipe materials without a source for their figures


@dataclass(frozen=True)
class Figure:
    """Property of a material, such as its density, in SI: least and greatest value in its sources, and the value used.

    key : name of the property; sources : keys of `SOURCES`
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
        sources = "; ".join(SOURCES[key] for key in self.sources)
        return f"{self.key.replace('_', ' ')} {self.used / SI[self.key]:.4g}{UNITS[self.key]}{span}{form}: {sources}"


@dataclass(frozen=True)
class Material:
    """Material of the catalogue; figures : key of a property -> its values (`Figure`)."""

    name: str
    figures: dict[str, Figure] = field(default_factory=dict)

    @property
    def missing_keys(self) -> list[str]:
        """Keys of the properties for which there is no source."""
        return [key for key in KEYS.values() if key not in self.figures]


@functools.cache
def materials() -> dict[str, Material]:
    """Catalogue of materials: name -> material."""
    catalogue: dict[str, Material] = {}
    for line in TABLE.strip().splitlines():
        name, short, least, greatest, *rest = line.split(maxsplit=4)
        words, key = rest[0].split("  "), KEYS[short]
        sources = tuple(entry.strip() for entry in words[0].split(","))
        low, high = (float(x) * SI[key] for x in (least, greatest))
        entry = Figure(key, low, high, sources, words[-1].strip() if len(words) > 1 else "")
        catalogue.setdefault(name, Material(name)).figures[key] = entry
    return catalogue

"""Density laws log, table and mixture: density, enthalpy, mass per length, pressure force and wave speed of a pipe.

Each function calls the function of the same name of the law that the scene uses (`dispatch_law`); each law has its own
file. The law `linear` is not among them: its kernels use pressures as states and are 20 times as fast.
"""

from fvsolve.jit import inner, njit
from fvsolve.kernels.density import log, mixture, nobody, table
from fvsolve.kernels.records import LAW_LOG, LAW_MIXTURE, LAW_TABLE


@inner
def by_law(of_log, of_table, of_mixture, of_unknown, st, floats, *arguments):
    """Call the function of the law that a scene uses; for an unknown code the result is NaN.

    Functions are passed as module attributes: numba would store the address of a bare name, and a function with such
    an address is not cached.
    """
    code = st["law"]
    if code == LAW_LOG:
        return of_log(st, floats, *arguments)
    if code == LAW_TABLE:
        return of_table(st, floats, *arguments)
    if code == LAW_MIXTURE:
        return of_mixture(st, floats, *arguments)
    return of_unknown(st, floats, *arguments)


@njit
def log_density(st, floats, p):
    """(ln(rho / rho_ref), d ln rho / dp [1/Pa]) at a pressure."""
    return by_law(log.log_density, table.log_density, mixture.log_density, nobody.numbers, st, floats, p)


@njit
def density(st, floats, p):
    """rho [kg/m3] at a pressure."""
    return by_law(log.density, table.density, mixture.density, nobody.number, st, floats, p)


@njit
def enthalpy(st, floats, p):
    """h = integral of dp / rho from the reference pressure [J/kg]."""
    return by_law(log.enthalpy, table.enthalpy, mixture.enthalpy, nobody.number, st, floats, p)


@njit
def pressure_of_enthalpy(st, floats, h):
    """Pressure [Pa] at which `enthalpy` is h."""
    functions = log.pressure_of_enthalpy, table.pressure_of_enthalpy, mixture.pressure_of_enthalpy, nobody.number
    return by_law(*functions, st, floats, h)


@njit
def pressure_of_log(st, floats, compliance, q):
    """Pressure [Pa] at which ln(rho / rho_ref) + ln(A / A_ref) is q; compliance of the wall, 0 for a vessel [1/Pa]."""
    functions = log.pressure_of_log, table.pressure_of_log, mixture.pressure_of_log, nobody.number
    return by_law(*functions, st, floats, compliance, q)


@njit
def pressure_of_mass(st, floats, pipe, m):
    """Pressure [Pa] of a pipe that contains m [kg/m]."""
    functions = log.pressure_of_mass, table.pressure_of_mass, mixture.pressure_of_mass, nobody.number
    return by_law(*functions, st, floats, pipe, m)


@njit
def mass_of_pressure(st, floats, pipe, p):
    """Mass per length m = rho A [kg/m] and dm/dp of a pipe at a pressure."""
    functions = log.mass_of_pressure, table.mass_of_pressure, mixture.mass_of_pressure, nobody.numbers
    return by_law(*functions, st, floats, pipe, p)


@njit
def wall_area(st, floats, pipe, p):
    """Area A of a pipe at a pressure [m2]."""
    return by_law(log.wall_area, table.wall_area, mixture.wall_area, nobody.number, st, floats, pipe, p)


@njit
def thrust(st, floats, pipe, p):
    """Integral of A dp from the reference pressure [N]."""
    return by_law(log.thrust, table.thrust, mixture.thrust, nobody.number, st, floats, pipe, p)


@njit
def force_of_mass(st, floats, pipe, m):
    """`thrust` at the pressure of a pipe that contains m [kg/m] [N]; called often."""
    functions = log.force_of_mass, table.force_of_mass, mixture.force_of_mass, nobody.number
    return by_law(*functions, st, floats, pipe, m)


@njit
def impedance(st, floats, pipe, p):
    """rho c = sqrt(rho / (d ln m / dp)) of a pipe at a pressure [kg/m2/s]."""
    return by_law(log.impedance, table.impedance, mixture.impedance, nobody.number, st, floats, pipe, p)


@njit
def velocity_change(st, floats, pipe, p_from, p_to):
    """Integral of dp / (rho c) [m/s]: decrease of the velocity in a simple wave."""
    functions = log.velocity_change, table.velocity_change, mixture.velocity_change, nobody.number
    return by_law(*functions, st, floats, pipe, p_from, p_to)


@njit
def local_speed(st, floats, pipe, p):
    """Wave speed c of a pipe at a pressure [m/s]."""
    return by_law(log.local_speed, table.local_speed, mixture.local_speed, nobody.number, st, floats, pipe, p)

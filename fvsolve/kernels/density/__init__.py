"""Density laws `log`, `table`, `mixture`: density, enthalpy, mass per length, pressure force, wave speed of a pipe.

Each function calls the function of the same name of the law that the model uses (`dispatch_law`); each law has its own
file. The law `linear` is not among them: its kernels need no density, because the sum of both waves is proportional to
the pressure change, and are 20 times as fast.

Arguments common to these functions: `st`, record of settings; `floats`, numbers of the model; `pipe`, record of a pipe.
"""

from fvsolve.jit import inline, njit
from fvsolve.kernels.density import log_law, mixture_law, table_law, unknown_law
from fvsolve.kernels.dtypes import LAW_LOG, LAW_MIXTURE, LAW_TABLE


@inline
def dispatch_law(of_log, of_table, of_mixture, of_unknown, st, floats, *arguments):
    """Call the function of the law that a model uses, with (st, floats, *arguments); for an unknown code give NaN.

    of_log, of_table, of_mixture, of_unknown : functions for each law
    Functions are passed as module attributes: numba would store the address of a bare name, and a function with an
    address of this kind is not cached.
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
    """(ln(rho / rho_ref), d ln rho / dp [1/Pa]) at the pressure p [Pa], with density rho."""
    return dispatch_law(
        log_law.log_density, table_law.log_density, mixture_law.log_density, unknown_law.two_not_a_number, st, floats, p
    )


@njit
def density(st, floats, p):
    """Density rho [kg/m3] at the pressure p [Pa]."""
    return dispatch_law(
        log_law.density, table_law.density, mixture_law.density, unknown_law.not_a_number, st, floats, p
    )


@njit
def enthalpy(st, floats, p):
    """Specific enthalpy h at the pressure p: integral of dp / rho from the reference pressure [J/kg]."""
    return dispatch_law(
        log_law.enthalpy, table_law.enthalpy, mixture_law.enthalpy, unknown_law.not_a_number, st, floats, p
    )


@njit
def pressure_of_enthalpy(st, floats, h):
    """Pressure [Pa] at which the specific enthalpy is h [J/kg]."""
    functions = (
        log_law.pressure_of_enthalpy,
        table_law.pressure_of_enthalpy,
        mixture_law.pressure_of_enthalpy,
        unknown_law.not_a_number,
    )
    return dispatch_law(*functions, st, floats, h)


@njit
def pressure_of_log(st, floats, compliance, q):
    """Pressure [Pa] at which ln(rho / rho_ref) + ln(A / A_ref) is q, with density rho and area A.

    compliance : relative area change of the wall per pressure [1/Pa], 0 for a vessel
    """
    functions = (
        log_law.pressure_of_log,
        table_law.pressure_of_log,
        mixture_law.pressure_of_log,
        unknown_law.not_a_number,
    )
    return dispatch_law(*functions, st, floats, compliance, q)


@njit
def pressure_of_mass(st, floats, pipe, m):
    """Pressure [Pa] of a pipe that contains the mass per length m [kg/m]."""
    functions = (
        log_law.pressure_of_mass,
        table_law.pressure_of_mass,
        mixture_law.pressure_of_mass,
        unknown_law.not_a_number,
    )
    return dispatch_law(*functions, st, floats, pipe, m)


@njit
def mass_of_pressure(st, floats, pipe, p):
    """Mass per length m = rho A [kg/m] and dm/dp [kg/m/Pa] of a pipe at the pressure p, with density rho and area A."""
    functions = (
        log_law.mass_of_pressure,
        table_law.mass_of_pressure,
        mixture_law.mass_of_pressure,
        unknown_law.two_not_a_number,
    )
    return dispatch_law(*functions, st, floats, pipe, p)


@njit
def wall_area(st, floats, pipe, p):
    """Area of a pipe with elastic wall at the pressure p [m2]."""
    return dispatch_law(
        log_law.wall_area, table_law.wall_area, mixture_law.wall_area, unknown_law.not_a_number, st, floats, pipe, p
    )


@njit
def thrust(st, floats, pipe, p):
    """Pressure force in a pipe: integral of A dp from the reference pressure to p [N], A : area of the pipe."""
    return dispatch_law(
        log_law.thrust, table_law.thrust, mixture_law.thrust, unknown_law.not_a_number, st, floats, pipe, p
    )


@njit
def force_of_mass(st, floats, pipe, m):
    """Pressure force (`thrust`) [N] in a pipe that contains the mass per length m [kg/m]."""
    functions = log_law.force_of_mass, table_law.force_of_mass, mixture_law.force_of_mass, unknown_law.not_a_number
    return dispatch_law(*functions, st, floats, pipe, m)


@njit
def impedance(st, floats, pipe, p):
    """Impedance rho c = sqrt(rho / (d ln m / dp)) of a pipe at the pressure p [kg/m2/s].

    rho : density, c : wave speed, m : mass per length
    """
    return dispatch_law(
        log_law.impedance, table_law.impedance, mixture_law.impedance, unknown_law.not_a_number, st, floats, pipe, p
    )


@njit
def velocity_change(st, floats, pipe, p_from, p_to):
    """Riemann integral of a pipe: integral of dp / (rho c) from pressure p_from to p_to [m/s], negative if p falls.

    A forward simple wave increases the velocity by it, a backward simple wave reduces the velocity by it.
    rho : density, c : wave speed
    """
    functions = (
        log_law.velocity_change,
        table_law.velocity_change,
        mixture_law.velocity_change,
        unknown_law.not_a_number,
    )
    return dispatch_law(*functions, st, floats, pipe, p_from, p_to)


@njit
def local_speed(st, floats, pipe, p):
    """Wave speed of a pipe at the pressure p [m/s]."""
    return dispatch_law(
        log_law.local_speed,
        table_law.local_speed,
        mixture_law.local_speed,
        unknown_law.not_a_number,
        st,
        floats,
        pipe,
        p,
    )

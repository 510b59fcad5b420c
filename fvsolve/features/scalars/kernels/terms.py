"""Functions that scalars, reactions and heat add to the right-hand side, to probes and to events."""

from fvsolve.core.kernels.rhs_assembly import RhsTerms

PACKAGE = "fvsolve.features.scalars.kernels"
AMOUNTS = RhsTerms(
    package=PACKAGE,
    outlet_values="scalar_transport: clear_losses",
    observe="scalar_transport: observe_scalars",
)
MIXED = RhsTerms(package=PACKAGE, mix="scalar_transport: mix_scalars")
CARRIED = RhsTerms(
    package=PACKAGE,
    outlet_values="scalar_transport: pipe_outlet_values",
    scalar_rates="scalar_transport: scalar_rates",
)
REACTIONS = RhsTerms(
    package=PACKAGE,
    prepare="reactions: limit_rates",
    scalar_rates="reactions: reaction_rates",
    observe="reactions: observe_reactions",
)
HEAT = {
    True: RhsTerms(
        package=PACKAGE,
        outlet_values="fluid_heat: heat_of_restrictions",
        scalar_rates="fluid_heat: heat_of_pipes",
    ),
    False: RhsTerms(
        package=PACKAGE,
        outlet_values="fluid_heat: heat_of_restrictions_barotropic",
        scalar_rates="fluid_heat: heat_of_pipes_barotropic",
    ),
}
HEAT_FOR_EVENTS = {
    True: RhsTerms(package=PACKAGE, events="fluid_heat: heat_for_events"),
    False: RhsTerms(package=PACKAGE, events="fluid_heat: heat_for_events_barotropic"),
}
VALUES_FOR_EVENTS = RhsTerms(package=PACKAGE, events="scalar_transport: mix_for_events")
VISCOSITY = RhsTerms(package=PACKAGE, rates="viscosity: viscous_friction")
REYNOLDS = RhsTerms(package=PACKAGE, network_power="viscosity: write_reynolds")

"""Relays, latches and timers in the tables of a model, and their state at the start."""

from fvsolve.features.controls.rows import StaticRows
from fvsolve.features.controls.switching import law

CHANGES = ("turns on", "turns off")


class SwitchingRows(StaticRows, kind=""):
    """Conversion of blocks with two states to table rows; mode : number in the law; flags : texts of their events."""

    law = law
    mode = law.RELAY
    flags: tuple[str, ...] = CHANGES

    def thresholds(self, control) -> tuple[float, float]:
        """Last two numbers of the block."""
        return 0.0, 0.0

    def numbers(self, draft, name, block):
        control = block.control
        flag = draft.flags(f"controls.{name}", self.flags)
        return [float(self.mode), float(flag), *control.output, *self.thresholds(control)]

    def state(self, control, start) -> bool:
        """State at the start."""
        return (
            bool(control.initial) if control.initial is not None else self.state_of(control, start)
        )

    def state_of(self, control, start) -> bool:
        """State that the inputs imply."""
        return start.inputs[0] > law.THRESHOLD

    def value(self, control, start):
        return control.output[self.state(control, start)]

    def flags_at_start(self, control, start, numbers):
        return {int(numbers[law.FLAG]): self.state(control, start)}


class RelayRows(SwitchingRows, kind="relay"):
    """Conversion of relays to table rows."""

    def thresholds(self, control):
        return control.on, control.off

    def state_of(self, control, start):
        x = start.inputs[0]
        return x <= control.on if control.on < control.off else x >= control.on

    def fault(self, control, start):
        low, high = sorted((control.on, control.off))
        if control.initial is None and low < start.inputs[0] < high:
            value = start.case.amount(start.inputs[0], start.block.dimensions[0], 6).removesuffix(
                " -"
            )
            return f"its input is {value} at the start, between `on` and `off`; give the key `initial`, 0 or 1"
        if not low < start.inputs[0] < high and self.state(control, start) != self.state_of(
            control, start
        ):
            known = [
                start.case.amount(x, start.block.dimensions[0], 6)
                for x in (start.inputs[0], control.on, control.off)
            ]
            text = (
                "`initial` is {}, but its input is {} at the start, with `on` at {} and `off` at {}"
            )
            text = text.format(control.initial, *(item.removesuffix(" -") for item in known))
            return f"{text}; expected {int(self.state_of(control, start))}, or leave this key out"
        return ""


class LatchRows(SwitchingRows, kind="latch"):
    """Conversion of latches to table rows."""

    mode = law.LATCH


class TimerRows(SwitchingRows, kind="timer"):
    """Conversion of timers to table rows."""

    mode = law.TIMER
    flags = ("", "", *CHANGES)

    def thresholds(self, control):
        return control.on_delay, control.off_delay

    def flags_at_start(self, control, start, numbers):
        flag = int(numbers[law.FLAG])
        return {flag: self.state_of(control, start), flag + 2: self.state(control, start)}

    def timed_flag(self, numbers):
        return int(numbers[law.FLAG])

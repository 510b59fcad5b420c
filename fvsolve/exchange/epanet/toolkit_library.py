"""EPANET 2.2's library through its C functions, under the names of the Python module of EPANET 2.3's toolkit."""

import ctypes
import os
from typing import Any

LARGEST_NAME = 256


class Library:
    """Functions and codes of EPANET 2.2's toolkit that a solution needs; each raises RuntimeError at an error.

    The codes are those of EPANET's header `epanet2_enums.h`.
    """

    NODECOUNT, LINKCOUNT = 0, 2
    TRIALS, ACCURACY, UNBALANCED = 0, 1, 11
    DURATION, HYDSTEP, REPORTSTEP, REPORTSTART, RULESTEP = 0, 1, 5, 6, 7
    HEAD, DEMAND = 10, 9
    FLOW, HEADLOSS, STATUS, SETTING, PUMP_STATE = 8, 10, 11, 12, 16
    PUMP = 2
    RELATIVEERROR = 1
    PDA = 1
    CFS, GPM, MGD, IMGD, AFD, LPS, LPM, MLD, CMH, CMD = range(10)
    CMS = -1  # unknown to EPANET 2.2

    def __init__(self, path: str) -> None:
        self.library = ctypes.CDLL(path)

    def call(self, name: str, *arguments: Any) -> int:
        """Call a function; return its warning code. Raises RuntimeError for an error code."""
        code = getattr(self.library, f"EN_{name}")(*arguments)
        if code > 100:
            text = ctypes.create_string_buffer(LARGEST_NAME)
            self.library.EN_geterror(code, text, LARGEST_NAME)
            raise RuntimeError(text.value.decode("utf-8", "replace"))
        return code

    def _number(self, name: str, *arguments: Any) -> float:
        value = ctypes.c_double()
        self.call(name, *arguments, ctypes.byref(value))
        return value.value

    def _integer(self, name: str, *arguments: Any) -> int:
        value = ctypes.c_int()
        self.call(name, *arguments, ctypes.byref(value))
        return value.value

    def createproject(self) -> Any:
        project = ctypes.c_void_p()
        self.call("createproject", ctypes.byref(project))
        return project

    def open(self, project: Any, *files: str) -> None:
        self.call("open", project, *(os.fsencode(name) for name in files))

    def close(self, project: Any) -> None:
        self.call("close", project)

    def getcount(self, project: Any, code: int) -> int:
        return self._integer("getcount", project, code)

    def getflowunits(self, project: Any) -> int:
        return self._integer("getflowunits", project)

    def getlinktype(self, project: Any, index: int) -> int:
        return self._integer("getlinktype", project, index)

    def getnodevalue(self, project: Any, index: int, code: int) -> float:
        return self._number("getnodevalue", project, index, code)

    def getlinkvalue(self, project: Any, index: int, code: int) -> float:
        return self._number("getlinkvalue", project, index, code)

    def getoption(self, project: Any, code: int) -> float:
        return self._number("getoption", project, code)

    def getstatistic(self, project: Any, code: int) -> float:
        return self._number("getstatistic", project, code)

    def setoption(self, project: Any, code: int, value: float) -> None:
        self.call("setoption", project, code, ctypes.c_double(value))

    def settimeparam(self, project: Any, code: int, value: int) -> None:
        self.call("settimeparam", project, code, ctypes.c_long(value))

    def setdemandmodel(
        self, project: Any, kind: int, minimum: float, required: float, exponent: float
    ) -> None:
        self.call(
            "setdemandmodel", project, kind, *map(ctypes.c_double, (minimum, required, exponent))
        )

    def openH(self, project: Any) -> None:
        self.call("openH", project)

    def initH(self, project: Any, flag: int) -> None:
        self.call("initH", project, flag)

    def closeH(self, project: Any) -> None:
        self.call("closeH", project)

    def runH(self, project: Any) -> int:
        return self._time("runH", project)

    def nextH(self, project: Any) -> int:
        return self._time("nextH", project)

    def _time(self, name: str, project: Any) -> int:
        value = ctypes.c_long()
        self.call(name, project, ctypes.byref(value))
        return value.value

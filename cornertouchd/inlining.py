"""Compile functions as mere parts of others: numba's own way would make each one executable.

It would optimise every function together with all that it calls, and write machine code for it,
though only the outermost one is ever run; that takes a third of the first start.  A part is left as
it was translated, until the function that is run is optimised as a whole.
"""

from typing import Any

from numba._dynfunc import make_function  # type: ignore[import-not-found]
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class _PartLibrary(JITCodeLibrary):
    """Code to link into that of callers."""

    def _optimize_final_module(self) -> None:
        """Leave it to the caller's, which this is linked into."""

    def _finalize_final_module(self) -> None:
        """Write no machine code."""
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[no-untyped-call]
class _PartLowering(NativeLowering):
    """Translates a function for those that call it, and for nobody else."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Do so; callers know the part by a function without code."""
        name = state.func_id.func_qualname
        state.library = _PartLibrary(state.targetctx.codegen(), name)  # type: ignore[no-untyped-call]
        state.flags.no_compile = True
        super().run_pass(state)  # type: ignore[no-untyped-call]
        lowered = state["cr"]
        module = lowered.fndesc.lookup_module()
        known_as = make_function(module, name, "", 0, lowered.env, (state.library,))
        state.targetctx.insert_user_function(known_as, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=known_as)
        return True


class PartCompiler(CompilerBase):
    """numba's compiler but for the last step; a `pipeline_class` of `numba.njit`."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the one way in which it compiles."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)  # type: ignore[no-untyped-call]
        passes.passes = [
            (_PartLowering if one is NativeLowering else one, what) for one, what in passes.passes
        ]
        passes.finalize()
        return [passes]

"""Arguments of kernels by name: as the compiler has them, whatever stands around them in the source."""

from __future__ import annotations

import numpy as np
import pyopencl as cl
import pytest
from problems import random_problem

import persfs_cl as ps
from persfs_cl._cl.arguments import Argument, arguments_of
from persfs_cl._cl.kernel import kernel
from persfs_cl._cl.orderings.checkerboard import Checkerboard
from persfs_cl._cl.orderings.checkerboard_bands import CheckerboardBands
from persfs_cl._cl.orderings.lexicographic import Lexicographic
from persfs_cl._cl.orderings.three_colours import ThreeColours
from persfs_cl._cl.orderings.wavefront_images import WavefrontImages
from persfs_cl._cl.orderings.wavefront_strips import WavefrontStrips
from persfs_cl._cl.orderings.wavefront_tiles import WavefrontTiles
from persfs_cl._cl.program import kernel_source, program
from persfs_cl._cl.registers import lanes
from persfs_cl.solver.problem import Problem

SOURCE = """
/* __kernel void odd(const int commented_out) is no kernel. */
#define HINT __attribute__((opencl_unroll_hint(4)))
static inline int helper(const int kernel_of, __global int *a) { return kernel_of; }

__kernel __attribute__((reqd_work_group_size(1, (2 * 1), 1))) __attribute__((vec_type_hint(int4)))
void odd(__global real *z,             /* a comment, with a comma (and a parenthesis */
         __global const int4 *restrict inwards,
         __global volatile int* sync, // one more, of the other kind
         __local float scratch[],
         const int first __attribute__((unused)), const float tolerance,
         real
         factor,
         uint count,
         const long far)
{
}

kernel void plain(void) {}
"""


def test_arguments_are_read_whatever_stands_around_them() -> None:
    assert arguments_of(SOURCE, "odd", np.float64) == (
        Argument("z", None),
        Argument("inwards", None),
        Argument("sync", None),
        Argument("scratch", None),
        Argument("first", np.int32),
        Argument("tolerance", np.float32),
        Argument("factor", np.float64),
        Argument("count", np.uint32),
        Argument("far", np.int64),
    )
    assert arguments_of(SOURCE, "plain", np.float32) == ()


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("__kernel void other(const int a) {}", "no __kernel function 'odd'"),
        ("__kernel void odd(const int4 a) {}", "'const int4 a' of the kernel 'odd' is neither"),
        ("__kernel void odd(read_only image2d_t a) {}", "'read_only image2d_t a' of the kernel 'odd' is neither"),
        ("__kernel void odd(int a,\n#if X\nint b\n#endif\n) {}", "of the kernel 'odd' is neither"),
        ("__kernel void odd(const int a", "not closed"),
    ],
)
def test_what_is_no_argument_of_ours_is_refused(source: str, message: str) -> None:
    with pytest.raises(ps.KernelBuildError, match=message):
        arguments_of(source, "odd", np.float32)


def every_kernel(device: ps.Device, problem: Problem) -> list[tuple[list[str], dict[str, int], str]]:
    """Files, constants and function of each."""
    sweeping = problem.kernels
    orderings = [Lexicographic(), WavefrontTiles(), Checkerboard(), ThreeColours()]
    # As narrow and as low as can be: the arguments are the same.
    strips = [WavefrontStrips(2, vectors=1), WavefrontImages(2, vectors=1)]
    vectors = [*strips, CheckerboardBands(2)] if lanes(device, "float32") > 1 else []
    return [
        *(([*sweeping, *one.kernels], one.definitions, one.function) for one in [*orderings, *vectors]),
        (["boundary", "renew"], {}, "renew_boundary"),
        (["change", "measure"], {}, "measure"),
        ([*problem.model.kernels, "render"], {}, "render"),
        (["registers"], {}, "registers"),
        (["roofline"], {}, "copy"),
        (["roofline"], {}, "multiply_adds"),
    ]


# By the quick tests every kernel is launched with what is read here, and does what it should.
@pytest.mark.thorough
def test_arguments_are_those_of_the_compiler(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = cl.Program.build
    asking = ["-cl-kernel-arg-info", "-cl-opt-disable"]
    monkeypatch.setattr(cl.Program, "build", lambda self, options: usual(self, [*options, *asking]))
    problem = random_problem(1, (4, 4))
    fields = list(problem.kernel_arguments.parameters)
    about, private = cl.kernel_arg_info, cl.kernel_arg_address_qualifier.PRIVATE
    for files, constants, function in every_kernel(device, problem):
        # A constant that is not used makes a program of its own.
        built = program(device, files, "float32", {**constants, "ONLY_TO_ASK_FOR_ARGUMENTS": 1}, fields)
        compiled = cl.Kernel(built, function)
        expected = [
            (
                compiled.get_arg_info(place, about.NAME),
                compiled.get_arg_info(place, about.ADDRESS_QUALIFIER) != private,
            )
            for place in range(compiled.num_args)
        ]
        found = arguments_of("\n".join(map(kernel_source, files)), function, np.float32)
        assert [(argument.name, argument.scalar is None) for argument in found] == expected


def test_a_launch_that_lacks_an_argument_names_it_and_the_kernel() -> None:
    (device, *_) = ps.devices()
    values = {"from": 0, "elsewhere": 1}
    with pytest.raises(ps.KernelBuildError, match=r"kernel copy of roofline declares the argument 'to'.*elsewhere"):
        kernel(device, ["roofline"], "float32", None, "copy").launch(device, (1,), None, values)

"""The law's number type for a CPU: a vector register with a robot in each lane.

The types are the compiler's own vector types, which stay in registers; a width of one is a vector
of one lane, so that the same text serves robots that share their topology with nobody.
"""

import functools
import re

import warp as wp

from warp_springs.kernels.buffers import real_dtype, wide_dtype

__all__ = [
    "PROCESSOR_OPTIONS",
    "native_width",
    "quad_operations",
    "scalar_dialect",
    "vector_dialect",
]


#: How a module of kernels for this processor is compiled.
PROCESSOR_OPTIONS = {
    "enable_backward": False,
    "optimization_level": 3,
    "cpu_compiler_flags": "-march=native -mprefer-vector-width=512",
}


@wp.func_native("""
#if defined(__AVX512F__)
return 64;
#elif defined(__AVX__)
return 32;
#else
return 16;
#endif
""")
def register_bytes() -> int: ...


@wp.kernel(module="warp_springs_registers", enable_backward=False)
def _measure(
    # outputs
    size: wp.array(dtype=wp.int32),
):
    size[0] = register_bytes()


@functools.cache
def native_width(precision: str) -> int:
    """Lanes of one vector register, as Warp's compiler targets this processor."""
    size = wp.zeros(1, dtype=wp.int32, device="cpu")
    wp.launch(_measure, 1, outputs=[size], device="cpu")
    return int(size.numpy()[0]) // real_dtype(precision).itemsize


_SELECT = "real operator()(mask m, real a, real b) const { return m ? a : b; }"
_VECTOR_ROOT = "real operator()(real a) const { return __builtin_elementwise_sqrt(a); }"

# Bytes of a scalar, the integer of its size, TINY, and the processor's estimate of 1 / sqrt(a):
# its name, the lanes of a whole register, and its mask's type.
_TYPES = {
    "float32": ("float", "int", 4, "1e-30f", "rsqrt14ps", 16, "unsigned short"),
    "float64": ("double", "long long", 8, "1e-200", "rsqrt14pd", 8, "unsigned char"),
}

# The estimate y of 1 / sqrt(a) errs by less than 2^-14. With e = 1 - a y^2 the series of
# (1 - e)^(-1/2), to e for float32 and to e^3 for float64, leaves the last bit or two; 2 + e is
# 3 - a y^2. Processors without the estimate take square root and division.
_SERIES = {
    "float32": "(h * y) * (three - (a * y) * y)",
    "float64": "(h * y) * (two + e * (one + e * (second + e * third)))",
}
# Read once, before the steps: a constant would be fetched from memory again for every spring.
_TERMS = """
    const volatile scalar terms[5] = {1, 2, 3, 0.75, 0.625};
    const real one = zero + terms[0], two = zero + terms[1], three = zero + terms[2];
    const real second = zero + terms[3], third = zero + terms[4];
"""


def _on_both(name: str, own: str, root: str = "") -> str:
    """C++ text: a function of the run's numbers, and in mixed precision of wide ones as well.

    ``own`` is its text for the former, where ``ROOT`` is their square root, and ``root`` its name.
    """
    other = re.sub(r"\b(real|mask|scalar)\b", _wider, own).replace("ROOT", "::sqrt")
    return f"""
    struct {{
        __attribute__((always_inline)) {own.replace("ROOT", root)}
    #if MIXED
        __attribute__((always_inline)) {other}
    #endif
    }} const {name}{{}};"""


def _wider(found: re.Match) -> str:
    return {"real": "wide", "mask": "wide_mask", "scalar": "wide_scalar"}[found[0]]


def vector_dialect(precision: str, width: int) -> str:
    """C++ text that defines the names ``kernels.law`` asks a dialect for."""
    name = real_dtype(precision).name
    scalar, integer, size, tiny, estimate, whole, bits = _TYPES[name]
    wide = wide_dtype(precision).itemsize * width
    return f"""
    #undef MIXED
    #define MIXED {int(precision == "mixed")}
    #pragma clang fp contract(on)
    typedef {scalar} scalar;
    typedef {integer} integer;
    typedef scalar real __attribute__((vector_size({size * width})));
    typedef integer mask __attribute__((vector_size({size * width})));
    typedef {"float" if wide == 4 * width else "double"} wide_scalar;
    typedef wide_scalar wide __attribute__((vector_size({wide}), aligned({min(wide, 64)})));
    typedef {"long long" if wide == 8 * width else "int"} wide_mask
        __attribute__((vector_size({wide})));
    const int W = {width};
    const scalar TINY = {tiny};
    const real zero = {{}};
    const wide wide_zero = {{}};
    {_on_both("select", _SELECT)}
    {_on_both("square_root", _VECTOR_ROOT)}
    {_on_both("lane_of", "scalar operator()(const real& a, int l) const { return a[l]; }")}
    struct {{
        __attribute__((always_inline)) real operator()(wide a) const {{
            return __builtin_convertvector(a, real);
        }}
        __attribute__((always_inline)) mask operator()(wide_mask a) const {{
            return __builtin_convertvector(a, mask);
        }}
    }} const narrow{{}};
    auto widen = [](real a) -> wide {{ return __builtin_convertvector(a, wide); }};
    auto any = [](mask m) -> bool {{ return __builtin_reduce_or(m) != 0; }};
    auto set_lane = [](real& a, int l, scalar value) {{ a[l] = value; }};
    {_TERMS}
    auto less_over_root = [=](real k, real h, real a) __attribute__((always_inline)) -> real {{
    #if defined(__AVX512F__) && defined(__AVX512VL__)
        typedef scalar part __attribute__((vector_size(16)));
        typedef scalar whole __attribute__((vector_size({size * whole})));
        real y;
        if (W == {whole}) {{
            whole all = {{}};
            __builtin_memcpy(&all, &a, sizeof(a));
            all = __builtin_ia32_{estimate}512_mask(all, all, ({bits})-1);
            __builtin_memcpy(&y, &all, sizeof(y));
        }} else {{
            for (int l = 0; l < W; ++l) {{
                part single = {{}};
                single[0] = a[l];
                y[l] = __builtin_ia32_{estimate}128_mask(single, single, (unsigned char)-1)[0];
            }}
        }}
        const real e = one - (a * y) * y;
        return k - {_SERIES[name]};
    #else
        return k - (h + h) / __builtin_elementwise_sqrt(a);
    #endif
    }};
    """


def scalar_dialect(precision: str) -> str:
    """The same names for one number, on a GPU or a CPU."""
    name = real_dtype(precision).name
    scalar, _, _, tiny, *_ = _TYPES[name]
    return f"""
    #undef MIXED
    #define MIXED {int(precision == "mixed")}
    typedef {scalar} scalar;
    typedef {"float" if wide_dtype(precision).itemsize == 4 else "double"} wide_scalar;
    typedef scalar real;
    typedef wide_scalar wide;
    typedef bool mask;
    typedef bool wide_mask;
    const int W = 1;
    const scalar TINY = {tiny};
    const real zero = 0;
    const wide wide_zero = 0;
    {_on_both("select", _SELECT)}
    {_on_both("square_root", "real operator()(real a) const { return ROOT(a); }", _ROOT[name])}
    {_on_both("lane_of", "scalar operator()(real a, int) const { return a; }")}
    struct {{
        __attribute__((always_inline)) real operator()(wide a) const {{ return real(a); }}
        __attribute__((always_inline)) mask operator()(mask a) const {{ return a; }}
    }} const narrow{{}};
    auto widen = [](real a) -> wide {{ return a; }};
    auto any = [](mask m) -> bool {{ return m; }};
    auto set_lane = [](real& a, int, scalar value) {{ a = value; }};
    auto less_over_root = [](real k, real h, real a) -> real {{
    #if defined(__CUDA_ARCH__)
        {_DEVICE_ROOT[name]}
        return k - (h + h) * y;
    #else
        return k - (h + h) / {_ROOT[name]}(a);
    #endif
    }};
    """


_ROOT = {"float32": "::sqrtf", "float64": "::sqrt"}
# A GPU's own estimate errs by a bit or two in float32. In float64 the library's takes 1 / sqrt(a)
# to the last bit.
_DEVICE_ROOT = {
    "float32": 'real y; asm("rsqrt.approx.ftz.f32 %0, %1;" : "=f"(y) : "f"(a));',
    "float64": "const real y = ::rsqrt(a);",
}


def quad_operations(width: int) -> str:
    """C++ text: ``transpose`` and ``spread0`` ... ``spread3``, for four or more lanes.

    ``transpose`` takes four vectors of W / 4 rows (x, y, z, w) each to x, y, z, w of W rows, and
    back; row r of vector v goes to lane 4 r + v. ``spread1(g)`` repeats the y of every row.
    """

    def shuffle(*pattern: int) -> str:
        # Within each group of four lanes; from 4 on the second vector.
        return ", ".join(
            str(q + lane % 4 + (width if lane >= 4 else 0))
            for q in range(0, width, 4)
            for lane in pattern
        )

    spread = "".join(
        f"auto spread{i} = [](real g) __attribute__((always_inline)) -> real "
        f"{{ return __builtin_shufflevector(g, g, {shuffle(i, i, i, i)}); }};\n"
        for i in range(4)
    )
    return f"""
    auto transpose = [](real& a, real& b, real& c, real& d) __attribute__((always_inline)) {{
        const real ab = __builtin_shufflevector(a, b, {shuffle(0, 4, 1, 5)});
        const real ba = __builtin_shufflevector(a, b, {shuffle(2, 6, 3, 7)});
        const real cd = __builtin_shufflevector(c, d, {shuffle(0, 4, 1, 5)});
        const real dc = __builtin_shufflevector(c, d, {shuffle(2, 6, 3, 7)});
        a = __builtin_shufflevector(ab, cd, {shuffle(0, 1, 4, 5)});
        b = __builtin_shufflevector(ab, cd, {shuffle(2, 3, 6, 7)});
        c = __builtin_shufflevector(ba, dc, {shuffle(0, 1, 4, 5)});
        d = __builtin_shufflevector(ba, dc, {shuffle(2, 3, 6, 7)});
    }};
    {spread}
    """

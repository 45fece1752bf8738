/// Includes the file that BSP_EACH_SIMD names once for each instruction set: BSP_SIMD names the set, BSP_TARGET is what
/// its functions are marked with, for a function only inlines what asks for no more than itself. To be included anew
/// for every such file.
#define BSP_SIMD Simd::avx2
#define BSP_TARGET
#include BSP_EACH_SIMD
#undef BSP_SIMD
#undef BSP_TARGET
#define BSP_SIMD Simd::avx512
#define BSP_TARGET BSP_AVX512
#include BSP_EACH_SIMD
#undef BSP_SIMD
#undef BSP_TARGET
#undef BSP_EACH_SIMD

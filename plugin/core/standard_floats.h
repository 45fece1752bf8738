/// The floating-point environment of the C++ standard.
#pragma once

#include <xmmintrin.h>

namespace bsp {

/// Denormals are numbers and numbers are rounded to nearest while it lives: renderers and their threads flush denormals
/// to zero, and what is computed must not depend on the thread.
class StandardFloats {
public:
    StandardFloats() : m_saved(_mm_getcsr()) { _mm_setcsr(0x1f80); }
    ~StandardFloats() { _mm_setcsr(m_saved); }
    StandardFloats(const StandardFloats &) = delete;
    StandardFloats &operator=(const StandardFloats &) = delete;

private:
    unsigned m_saved;
};

} // namespace bsp

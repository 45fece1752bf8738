/// The wide node layout: three levels of a binary tree, seven planes and eight cells, in one node that a ray passes in
/// one step. A node whose planes all lie along the axes is one cache line; where some are oblique, their slopes are in
/// the line behind it.
#pragma once

#include <cstdint>
#include <vector>

#include "accelerator.h"
#include "binary_layout.h"
#include "large_pages.h"
#include "simd.h"
#include "tree.h"
#include "triangle_block.h"

namespace bsp {

/// What is in a cell of a wide node: nothing, another node, or the blocks of a leaf. Two spare bits belong to a plane.
class WideChild {
public:
    static constexpr std::uint32_t max_blocks = 7, max_index = (1u << 26) - 1;
    static constexpr unsigned axis_shift = 30;

    static WideChild node(std::uint32_t line, bool is_oblique) {
        return WideChild(is_oblique ? line | oblique_bit : line);
    }
    static WideChild leaf(std::uint32_t block, std::uint32_t blocks) {
        return WideChild(leaf_bit | blocks << 26 | block);
    }
    /// The child in `word`, whatever its spare bits say.
    static WideChild in(std::uint32_t word) { return WideChild(word & ((1u << axis_shift) - 1)); }
    WideChild() = default;

    bool is_empty() const { return m_word == 0; } ///< not for the root
    bool is_leaf() const { return (m_word & leaf_bit) != 0; }
    bool is_oblique() const { return (m_word & oblique_bit) != 0; } ///< of a node
    std::uint32_t index() const { return m_word & max_index; }      ///< of the node's line, or of the first block
    std::uint32_t block_count() const { return (m_word & ~leaf_bit) >> 26; }
    std::uint32_t with_axis(unsigned axis) const { return m_word | axis << axis_shift; }

private:
    static constexpr std::uint32_t leaf_bit = 1u << 29, oblique_bit = 1u << 26;
    explicit WideChild(std::uint32_t word) : m_word(word) {}

    std::uint32_t m_word = 0; ///< nothing; line 0 is the root, nobody's child
};

/// Plane i parts the cells of a treelet whose root is plane 0; the planes below and above plane i are 2i + 1 and 2i
/// + 2. Cell c is on the path that bit 2 of c takes at the first level, bit 1 at the second and bit 0 at the third.
/// Lane 7 of what belongs to planes is not used.
struct alignas(64) WideNode {
    static constexpr unsigned planes = 7, cells = 8;

    float offsets[8]; ///< infinite: no plane, everything is below. Not a number: no plane, everything is on both sides.
    std::uint32_t children[8]; ///< `WideChild` of each cell; in its spare bits, the major axis of the plane

    unsigned axis(unsigned plane) const { return children[plane] >> WideChild::axis_shift; }
};

/// The line behind a node with oblique planes: their normals are 1 along the major axis, and these along the next two.
struct alignas(64) WideSlopes {
    float a[8], b[8];
};

/// A cache line with a node or its slopes.
union WideLine {
    WideNode node;
    WideSlopes slopes;
};
static_assert(sizeof(WideLine) == 64);

/// The scene's box, ready to be loaded; lane 3 is 0.
struct alignas(16) WideBox {
    float lower[4], upper[4];
};

struct WideLayout {
    WideBox box;
    WideChild root;
    LargePageVector<WideLine> lines;
    LargePageVector<TriangleBlock> blocks;
    float plane_tolerance = 0;

    std::vector<MemoryPart> memory() const { return {memory_of(lines), memory_of(blocks)}; }
};

/// The split planes, in the order of the nodes.
std::vector<Plane> planes_of(const WideLayout &layout);

/// Throws std::length_error if the tree does not fit 26-bit indices.
WideLayout pack_wide(const Tree &tree, const TriangleSet &set);

} // namespace bsp

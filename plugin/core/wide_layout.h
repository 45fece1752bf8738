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

/// What is in a cell of a wide node: nothing, another node, or the blocks of a leaf. The two lowest bits are not its
/// own: they belong to a plane.
class WideChild {
public:
    static constexpr std::uint32_t max_blocks = 7, max_index = (1u << 26) - 1;
    static constexpr std::uint32_t axis_bits = 3; ///< where the major axis of a plane is

    static WideChild node(std::uint32_t line, bool is_oblique) {
        return WideChild(line << index_shift | (is_oblique ? oblique_bit : 0));
    }
    static WideChild leaf(std::uint32_t block, std::uint32_t blocks) {
        return WideChild(block << index_shift | leaf_bit | blocks << count_shift);
    }
    explicit WideChild(std::uint32_t word = 0) : m_word(word) {}

    bool is_empty() const { return (m_word & ~axis_bits) == 0; } ///< not for the root
    bool is_leaf() const { return (m_word & leaf_bit) != 0; }
    bool is_oblique() const { return (m_word & oblique_bit) != 0; } ///< of a node
    std::uint32_t index() const { return m_word >> index_shift; }   ///< of the node's line, or of the first block
    std::uint32_t block_count() const { return m_word >> count_shift & max_blocks; }
    std::uint32_t with_axis(std::uint32_t axis) const { return (m_word & ~axis_bits) | axis; }

private:
    static constexpr unsigned index_shift = 6, count_shift = 2;
    static constexpr std::uint32_t leaf_bit = 1u << 5, oblique_bit = 1u << 2;

    std::uint32_t m_word; ///< 0: nothing, for line 0 is the root, nobody's child
};

/// Plane i parts the cells of a treelet whose root is plane 0; the planes below and above plane i are 2i + 1 and 2i
/// + 2. Cell c is on the path that bit 2 of c takes at the first level, bit 1 at the second and bit 0 at the third.
/// Cells are in lanes of their own; each half of the lanes holds the planes on the paths to its four cells, so plane 0
/// is there twice.
struct alignas(64) WideNode {
    static constexpr unsigned planes = 7, cells = 8;
    static constexpr unsigned plane_of_lane[cells] = {0, 1, 3, 4, 0, 2, 5, 6},
                              lane_of_plane[planes] = {0, 1, 5, 2, 3, 6, 7};

    float offsets[cells]; ///< infinite: no plane, everything is below. Not a number: no plane, all is on both sides.
    std::uint32_t children[cells]; ///< `WideChild` of each cell; in its lowest bits the major axis of the lane's plane

    std::uint32_t axis(unsigned lane) const { return children[lane] & WideChild::axis_bits; }
};

/// The line behind a node with oblique planes: their normals are 1 along the major axis, and these along the next two.
struct alignas(64) WideSlopes {
    float a[WideNode::cells], b[WideNode::cells];
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
    Orientation orientation;
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

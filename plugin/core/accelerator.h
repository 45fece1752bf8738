/// What users of the library see: something that answers rays, whatever is inside.
#pragma once

#include <memory>
#include <string>

#include "build_monitor.h"
#include "primitives.h"
#include "ray.h"
#include "settings.h"
#include "statistics.h"
#include "triangles.h"

namespace bsp {

/// The points p with normal . p = offset.
struct Plane {
    Vec3f normal; ///< its largest component is 1
    float offset;
};

/// Answers rays about a fixed set of triangles and primitives; a primitive's hit has its id, and u and v of 0. All
/// queries may be made from many threads at once and never throw. Which rays hit nothing whatever the triangles,
/// `Scale` says.
class Accelerator {
public:
    virtual ~Accelerator() = default;

    virtual Hit closest(const Ray &ray) const noexcept = 0;
    virtual bool any(const Ray &ray) const noexcept = 0;
    virtual Hit count_closest(const Ray &ray, Counters &counters) const noexcept = 0;
    virtual bool count_any(const Ray &ray, Counters &counters) const noexcept = 0;

    /// All split planes, in the order of the nodes; none for brute force.
    virtual std::vector<Plane> planes() const = 0;
    /// Nodes and triangles, byte by byte the same for equal input and settings.
    virtual std::vector<MemoryPart> memory() const = 0;

    const Statistics &statistics() const { return m_statistics; }
    const Bounds &bounds() const { return m_bounds; } ///< of the triangles; empty if there are none

protected:
    Statistics m_statistics;
    Bounds m_bounds;
};

/// What decides nothing about the tree.
struct BuildOptions {
    std::string cache;                      ///< a folder of saved trees, created if it is missing; empty: none
    BuildMonitor *monitor = nullptr;        ///< watches the build and may cancel it
    const Primitives *primitives = nullptr; ///< who has the primitives of the set, if there are any; outlives the tree
};

/// Builds what the settings say, or loads it from the folder of saved trees if it was kept there before. Throws
/// std::bad_alloc, std::length_error, std::invalid_argument if the tree takes no primitives but there are some, or
/// BuildCancelled if the monitor says so.
std::unique_ptr<Accelerator> make_accelerator(TriangleSet set, const Settings &settings,
                                              const BuildOptions &options = {});

} // namespace bsp

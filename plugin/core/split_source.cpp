#include "split_source.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "fixed_directions.h"

namespace bsp {

void add_distinct(std::vector<Direction> &directions, const Direction &direction) {
    for (const Direction &known : directions)
        if (nearly_parallel(known, direction, same_direction_angle))
            return;
    directions.push_back(direction);
}

namespace {

/// Uniform on the sphere, signs aside.
class RandomDirections final : public SplitSource {
public:
    std::vector<Direction> directions(const NodeTriangles &, int count, Random random) const override {
        std::vector<Direction> found;
        for (int i = 0; i < count; ++i) {
            const double z = random.uniform(), angle = 2 * M_PI * random.uniform();
            const double r = std::sqrt(1 - z * z);
            add_distinct(found, make_direction({r * std::cos(angle), r * std::sin(angle), z}));
        }
        return found;
    }
};

/// The same in every node.
class FixedDirections final : public SplitSource {
public:
    explicit FixedDirections(std::vector<Direction> oblique) : m_oblique(std::move(oblique)) {}

    std::vector<Direction> directions(const NodeTriangles &, int, Random) const override { return m_oblique; }

private:
    std::vector<Direction> m_oblique;
};

/// `count` different indices below `size`, or all of them, in random order (Floyd's sampling keeps it O(count^2)).
std::vector<std::uint32_t> sample_indices(std::uint32_t size, std::uint32_t count, Random &random) {
    std::vector<std::uint32_t> chosen;
    if (count >= size) {
        chosen.resize(size);
        std::iota(chosen.begin(), chosen.end(), 0u);
        return chosen;
    }
    for (std::uint32_t j = size - count; j < size; ++j) {
        const std::uint32_t candidate = random.below(j + 1);
        const bool taken = std::find(chosen.begin(), chosen.end(), candidate) != chosen.end();
        chosen.push_back(taken ? j : candidate);
    }
    return chosen;
}

/// `count` indices drawn with probabilities in proportion to the areas of the clipped triangles, with repetitions.
std::vector<std::uint32_t> draw_by_area(const ReferenceList &references, std::uint32_t count, Random &random) {
    std::vector<double> sums(references.size());
    double total = 0;
    for (std::size_t i = 0; i < references.size(); ++i)
        sums[i] = total += references.area(i);
    std::vector<std::uint32_t> drawn;
    for (std::uint32_t i = 0; i < count && total > 0; ++i) {
        const auto found = std::upper_bound(sums.begin(), sums.end() - 1, total * random.uniform());
        drawn.push_back(std::uint32_t(found - sums.begin()));
    }
    return drawn;
}

/// At most `count` triangles of a node that stand for all of it.
std::vector<std::uint32_t> sample(const NodeTriangles &node, std::uint32_t count, Weighting weighting, Random &random) {
    return weighting == Weighting::area ? draw_by_area(node.references, count, random)
                                        : sample_indices(std::uint32_t(node.references.size()), count, random);
}

/// What is no triangle leads to no direction but one of the axes, which are tried anyway.
Vec3d normal_of(const NodeTriangles &node, std::uint32_t index) {
    if (is_primitive(node.references.ids[index]))
        return {1, 0, 0};
    return scaled_normal(node.set.triangles[node.references.ids[index]]);
}

/// The geometric normals of random triangles of the node: all of them when there are few. Many triangles share a normal
/// (walls), so more are drawn than are wanted, and those seen before are left out.
class TriangleNormals final : public SplitSource {
public:
    explicit TriangleNormals(Weighting weighting) : m_weighting(weighting) {}

    std::vector<Direction> directions(const NodeTriangles &node, int count, Random random) const override {
        constexpr std::uint32_t draws_per_direction = 4;
        std::vector<Direction> found;
        const std::uint32_t draws = draws_per_direction * std::uint32_t(count);
        for (const std::uint32_t index : sample(node, draws, m_weighting, random)) {
            add_distinct(found, make_direction(normal_of(node, index)));
            if (found.size() == std::size_t(count))
                break;
        }
        return found;
    }

private:
    Weighting m_weighting;
};

/// Centres of an axial k-means over the node's normals: a normal and its opposite are one direction, the centre of a
/// cluster is the normalised sum of its normals turned to one side. Seeded by k-means++ (Arthur, Vassilvitskii 2007).
class ClusteredNormals final : public SplitSource {
public:
    explicit ClusteredNormals(Weighting weighting) : m_weighting(weighting) {}

    std::vector<Direction> directions(const NodeTriangles &node, int count, Random random) const override {
        const std::vector<Vec3d> normals = sample_normals(node, random);
        if (normals.empty())
            return {};
        std::vector<Vec3d> centres = seed_centres(normals, count, random);
        for (int round = 0; round < max_rounds; ++round)
            if (!move_centres(normals, centres))
                break;
        std::vector<Direction> found;
        for (const Vec3d &centre : centres)
            add_distinct(found, make_direction(centre));
        return found;
    }

private:
    static constexpr std::uint32_t max_samples = 256; ///< so that a node costs O(1), and few of them are large
    static constexpr int max_rounds = 8;
    static constexpr double settled = 1e-6; ///< squared sine of the largest move that is none

    /// Squared sine of the angle between two unit vectors: the axial distance.
    static double distance(const Vec3d &x, const Vec3d &y) {
        const double cosine = dot(x, y);
        return std::max(0.0, 1 - cosine * cosine);
    }

    std::vector<Vec3d> sample_normals(const NodeTriangles &node, Random &random) const {
        std::vector<Vec3d> normals;
        for (const std::uint32_t index : sample(node, max_samples, m_weighting, random)) {
            const Vec3d normal = normal_of(node, index);
            if (!(normal == Vec3d{})) // as that of a triangle of the smallest numbers may come out
                normals.push_back(normal * (1 / norm(normal)));
        }
        return normals;
    }

    static std::vector<Vec3d> seed_centres(const std::vector<Vec3d> &normals, int count, Random &random) {
        std::vector<Vec3d> centres{normals[random.below(std::uint32_t(normals.size()))]};
        std::vector<double> nearest(normals.size(), 2.0);
        while (centres.size() < std::size_t(count)) {
            double total = 0;
            for (std::size_t i = 0; i < normals.size(); ++i) {
                nearest[i] = std::min(nearest[i], distance(normals[i], centres.back()));
                total += nearest[i];
            }
            if (total <= settled)
                break; // every normal is at a centre already
            double target = total * random.uniform();
            std::size_t chosen = 0;
            while (chosen + 1 < normals.size() && (target -= nearest[chosen]) >= 0)
                ++chosen;
            centres.push_back(normals[chosen]);
        }
        return centres;
    }

    /// One round of Lloyd's algorithm; whether any centre still moved.
    static bool move_centres(const std::vector<Vec3d> &normals, std::vector<Vec3d> &centres) {
        std::vector<Vec3d> sums(centres.size());
        for (const Vec3d &normal : normals) {
            std::size_t best = 0;
            for (std::size_t c = 1; c < centres.size(); ++c)
                if (distance(normal, centres[c]) < distance(normal, centres[best]))
                    best = c;
            sums[best] = sums[best] + normal * (dot(normal, centres[best]) < 0 ? -1.0 : 1.0);
        }
        bool moved = false;
        for (std::size_t c = 0; c < centres.size(); ++c) {
            const double length = norm(sums[c]);
            if (length == 0)
                continue; // an empty cluster keeps its centre
            const Vec3d centre = sums[c] * (1 / length);
            moved |= distance(centre, centres[c]) > settled;
            centres[c] = centre;
        }
        return moved;
    }

    Weighting m_weighting;
};

} // namespace

std::unique_ptr<SplitSource> make_split_source(const Settings &settings) {
    switch (settings.tree) {
    case TreeKind::rbsp: {
        std::vector<Direction> directions = fixed_directions(settings.directions, settings.k);
        directions.erase(directions.begin(), directions.begin() + 3); // the axes policy sees to them
        return std::make_unique<FixedDirections>(std::move(directions));
    }
    case TreeKind::random:
        return std::make_unique<RandomDirections>();
    case TreeKind::normals:
        return std::make_unique<TriangleNormals>(settings.weighting);
    case TreeKind::clustered:
        return std::make_unique<ClusteredNormals>(settings.weighting);
    case TreeKind::automatic:
    case TreeKind::kd:
    case TreeKind::ize:
    case TreeKind::brute:
        return nullptr;
    }
    throw std::logic_error("a tree that nobody makes a split source for");
}

} // namespace bsp

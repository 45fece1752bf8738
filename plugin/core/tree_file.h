/// Trees kept on disk: the neutral tree, before it is packed, in a file named after everything that decides it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "settings.h"
#include "tree.h"

namespace bsp {

/// The place of one tree in a folder of trees. Any number of processes may use it at the same time.
class TreeFile {
public:
    /// The name depends on the triangles, on the settings that shape the tree, and on the sources of this library, for
    /// another version may build another tree. Nothing is touched yet.
    TreeFile(const std::filesystem::path &folder, const TriangleSet &set, const Settings &settings);

    /// The tree, or nothing if there is no file. Throws std::runtime_error, in one sentence, if what is there is not
    /// this tree, whole and undamaged. Even a forged file gives a tree that is safe to traverse: it obeys `validate`.
    std::optional<Tree> load(const TriangleSet &set) const;

    /// Creates the folder if there is none. Readers and other writers see the old file or the new one, never a part.
    /// Throws std::runtime_error, in one sentence, if the tree cannot be written.
    void save(const Tree &tree) const;

    const std::filesystem::path &path() const { return m_path; }

private:
    std::uint64_t m_key;
    std::filesystem::path m_path;
};

} // namespace bsp

#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "io/npz.h"

namespace sole::io {

/// The arrays of a file that Python programs keep a dictionary in, found by content: .npz, .npy
/// with a pickled dictionary, or a bare pickle (protocols 0 to 5, also of Python 2). Numbers become
/// 0-d arrays, lists of numbers arrays of one or two dimensions, a dictionary within becomes the
/// keys "outer/inner". scipy.sparse matrices become dense, of chumpy objects only the stored array
/// is taken. What is no number, text or array is left out.
///
/// Pickles are programs; nothing is ever executed. A class or function other than the few that
/// build these values is refused by name. Memory stays within a small multiple of the file's size.
/// Throws Error with the path.
Npz ReadArrayDict(const std::filesystem::path& path);

/// The same from the bytes of a pickle; `where` starts every message.
Npz ParsePickledArrays(std::string_view pickle, const std::string& where);

}  // namespace sole::io

// Whether a call of the C++ wrapper throws an error of these words.
#pragma once

#include <cstring>

#include "viscera.hpp"

template <class Make> static bool throws(Make make, const char *words) {
    try {
        make();
    } catch (const viscera::Error &error) {
        return std::strstr(error.what(), words) != nullptr;
    }
    return false;
}

// Reads an EXR file with tinyexr: tiny FILE OUT. OUT as three.mjs writes it.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <tinyexr.h>

int main(int argc, char** argv) {
    if (argc != 3) return 2;
    float* rgba = nullptr;
    int size[2] = {0, 0};
    const char* error = nullptr;
    if (LoadEXR(&rgba, &size[0], &size[1], argv[1], &error) != TINYEXR_SUCCESS) {
        std::fprintf(stderr, "%s\n", error ? error : "no reason given");
        return 1;
    }
    FILE* out = std::fopen(argv[2], "wb");
    if (!out) return 2;
    const uint32_t sides[2] = {uint32_t(size[0]), uint32_t(size[1])};
    std::fwrite(sides, 4, 2, out);
    for (long k = 0; k < long(size[0]) * size[1]; k++) std::fwrite(rgba + 4 * k, 4, 3, out);
    std::fclose(out);
    std::free(rgba);
    return 0;
}

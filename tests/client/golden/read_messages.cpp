// Reads a frame or a pose, version 1, as described in client/glovecal_client/wire/README.md, and prints its
// values as JSON. Written from that document alone, to show that it is enough; for little-endian machines.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

static uint32_t crc32(const uint8_t *bytes, size_t count) {
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < count; ++i) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
    return ~crc;
}

template <typename T> static T at(const std::vector<uint8_t> &message, size_t offset) {
    T value;
    std::memcpy(&value, message.data() + offset, sizeof value);
    return value;
}

template <typename T>
static void print_list(const char *name, const std::vector<uint8_t> &message, size_t offset, size_t count) {
    std::printf(", \"%s\": [", name);
    for (size_t i = 0; i < count; ++i) {
        double value = at<T>(message, offset + i * sizeof(T));
        std::printf(std::isnan(value) ? "%snull" : "%s%.9g", i ? ", " : "", value);
    }
    std::printf("]");
}

static void print_common(const std::vector<uint8_t> &message) {
    std::printf("{\"flags\": %u, \"sequence\": %llu, \"monotonic_ns\": %lld, \"wall_ns\": %lld, \"run_id\": %llu",
                message[5], (unsigned long long)at<uint64_t>(message, 8), (long long)at<int64_t>(message, 16),
                (long long)at<int64_t>(message, 24), (unsigned long long)at<uint64_t>(message, 32));
}

static bool print_frame(const std::vector<uint8_t> &message) {
    size_t sensors = at<uint16_t>(message, 6), contexts = at<uint16_t>(message, 40);
    if (message.size() != 48 + 4 * sensors + 4 * contexts) return false;
    print_common(message);
    print_list<float>("readings", message, 44, sensors);
    print_list<float>("context", message, 44 + 4 * sensors, contexts);
    return true;
}

static bool print_pose(const std::vector<uint8_t> &message) {
    size_t rotations = at<uint16_t>(message, 6);
    if (message.size() != 92 + 9 * rotations) return false;
    print_common(message);
    std::printf(", \"skipped\": %llu, \"age_us\": %u, \"model_sha256\": \"",
                (unsigned long long)at<uint64_t>(message, 40), at<uint32_t>(message, 48));
    for (size_t i = 56; i < 88; ++i) std::printf("%02x", message[i]);
    std::printf("\"");
    print_list<float>("degrees", message, 88, rotations);
    print_list<float>("deviations", message, 88 + 4 * rotations, rotations);
    print_list<uint8_t>("rotation_flags", message, 88 + 8 * rotations, rotations);
    return true;
}

int main(int count, char **arguments) {
    if (count != 2) return 2;
    std::ifstream file(arguments[1], std::ios::binary);
    std::vector<uint8_t> message((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    if (message.size() < 48 || message[4] != 1) return 1;
    if (crc32(message.data(), message.size() - 4) != at<uint32_t>(message, message.size() - 4)) return 1;
    bool pose = std::memcmp(message.data(), "GLVP", 4) == 0;
    if (!pose && std::memcmp(message.data(), "GLVF", 4) != 0) return 1;
    if (pose && message.size() < 92) return 1;
    bool good = pose ? print_pose(message) : print_frame(message);
    if (good) std::printf("}\n");
    return good ? 0 : 1;
}

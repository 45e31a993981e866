// Live poses of one glove in C++17, without any library: by the WebSocket bridge, in the wire's own format
// (client/glovecal_client/wire/README.md). For Linux and macOS, little-endian.
//
//   glovecal bridge websocket &
//   c++ -std=c++17 -o subscribe subscribe.cpp && ./subscribe 127.0.0.1 8766 right
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

using Bytes = std::vector<uint8_t>;
static const size_t LARGEST = 1 << 20;

template <typename T> static T at(const Bytes &message, size_t offset) {
    T value;
    if (offset + sizeof value > message.size()) throw std::runtime_error("a message is shorter than it says");
    std::memcpy(&value, message.data() + offset, sizeof value);
    return value;
}

static int connected(const char *host, const char *port) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_STREAM;
    if (getaddrinfo(host, port, &hints, &found) != 0) throw std::runtime_error("no such host");
    int opened = socket(found->ai_family, found->ai_socktype, found->ai_protocol);
    bool is_there = connect(opened, found->ai_addr, found->ai_addrlen) == 0;
    freeaddrinfo(found);
    if (!is_there) throw std::runtime_error("nobody listens there: glovecal bridge websocket");
    return opened;
}

static Bytes taken(int opened, size_t count) {
    Bytes bytes(count);
    for (size_t have = 0; have < count;) {
        ssize_t more = recv(opened, bytes.data() + have, count - have, 0);
        if (more <= 0) throw std::runtime_error("the bridge ended");
        have += static_cast<size_t>(more);
    }
    return bytes;
}

static void put(int opened, const std::string &text) {
    if (send(opened, text.data(), text.size(), 0) != static_cast<ssize_t>(text.size()))
        throw std::runtime_error("the bridge ended");
}

static void shake_hands(int opened, const std::string &host, const std::string &path) {
    put(opened, "GET " + path + " HTTP/1.1\r\nHost: " + host + "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                "Sec-WebSocket-Key: Z2xvdmVjYWwgZXhhbXBsZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n");
    std::string answer;
    while (answer.find("\r\n\r\n") == std::string::npos) answer += static_cast<char>(taken(opened, 1)[0]);
    if (answer.compare(0, 12, "HTTP/1.1 101") != 0) throw std::runtime_error(answer.substr(0, answer.find('\r')));
}

// Names of the rotations in the text that explains a glove's poses: its only list of texts called so.
static std::vector<std::string> names_in(const std::string &text) {
    std::vector<std::string> names;
    const std::string key = "\"rotations\": [";
    size_t place = text.find(key + '"');
    if (place == std::string::npos) return names;
    place += key.size();
    for (size_t end = text.find(']', place); place < end && text[place] == '"'; place = text.find('"', place)) {
        size_t stop = text.find('"', place + 1);
        names.push_back(text.substr(place + 1, stop - place - 1));
        place = stop + 1;
    }
    return names;
}

static void show(const Bytes &pose, const std::vector<std::string> &names) {
    if (pose.size() < 92 || std::memcmp(pose.data(), "GLVP\x01", 5) != 0) return;
    size_t count = at<uint16_t>(pose, 6);
    int flags = pose[5];
    std::printf("%llu%s%s", static_cast<unsigned long long>(at<uint64_t>(pose, 8)), flags & 1 ? " uncalibrated" : "",
                flags & 2 ? " stale" : "");
    for (size_t i = 0; i < count && i < names.size(); ++i) {
        bool is_usable = (at<uint8_t>(pose, 88 + 8 * count + i) & (2 | 8)) == 0;  // too uncertain, faulty sensor
        std::printf(" %s %.2f+-%.2f%s", names[i].c_str(), at<float>(pose, 88 + 4 * i),
                    at<float>(pose, 88 + 4 * count + 4 * i), is_usable ? "" : "!");
    }
    std::printf("\n");
    std::fflush(stdout);
}

int main(int count, char **words) try {
    std::string host = count > 1 ? words[1] : "127.0.0.1", port = count > 2 ? words[2] : "8766";
    int opened = connected(host.c_str(), port.c_str());
    shake_hands(opened, host + ":" + port, std::string("/binary/") + (count > 3 ? words[3] : "right"));
    std::vector<std::string> names;
    while (true) {
        Bytes head = taken(opened, 2);
        int kind = head[0] & 15;
        size_t length = head[1] & 127;
        if (length > 125) {
            Bytes size = taken(opened, length == 126 ? 2 : 8);
            length = 0;
            for (uint8_t byte : size) length = length << 8 | byte;
        }
        if (length > LARGEST) throw std::runtime_error("that is no bridge of Glovecal");
        Bytes body = taken(opened, length);
        if (kind == 1) names = names_in({body.begin(), body.end()});
        if (kind == 2) show(body, names);
        if (kind == 8) return 0;
        if (kind == 9 && length < 126) {  // it asks whether we are there, and wants its own bytes back
            std::string pong("\x8A\x80\0\0\0\0", 6);
            pong[1] = static_cast<char>(128 + length);
            put(opened, pong + std::string(body.begin(), body.end()));
        }
    }
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}

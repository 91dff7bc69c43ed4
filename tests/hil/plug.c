/* A hand at a USB socket, in the guest: `plug ADDRESS PORT` plugs the camera that is served there (USB/IP) into the kernel's
 * virtual host controller, and again whenever it is pulled out and can be had. Debian's `usbip` would bring udev's library
 * and a daemon's worth of code for these few lines. */
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define CONTROLLER "/sys/devices/platform/vhci_hcd.0/"

/* Whether the controller's first socket is empty: `hs 0000 004 …`. */
static bool empty(void) {
    char line[128];
    unsigned socket, state;
    FILE *status = fopen(CONTROLLER "status", "r");
    bool is = false;
    while (status && fgets(line, sizeof line, status))
        if (sscanf(line, "hs %u %u", &socket, &state) == 2 && socket == 0) is = state == 4;
    if (status) fclose(status);
    return is;
}

static bool whole(int from, void *bytes, size_t count) {
    return recv(from, bytes, count, MSG_WAITALL) == (ssize_t)count;
}

/* The device is asked for and handed to the kernel. */
static bool plug(const struct sockaddr_in *where) {
    /* Version 1.1.1, import, status; the bus as the exporting side calls it. */
    uint8_t request[40] = {0x01, 0x11, 0x80, 0x03}, answer[320];
    int line = socket(AF_INET, SOCK_STREAM, 0), one = 1;
    bool done = false;
    strcpy((char *)request + 8, "1-1");
    setsockopt(line, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    if (!connect(line, (const struct sockaddr *)where, sizeof *where) &&
        write(line, request, sizeof request) == sizeof request && whole(line, answer, sizeof answer) && !answer[7]) {
        uint32_t bus, number, speed;
        memcpy(&bus, answer + 8 + 288, 4);
        memcpy(&number, answer + 8 + 292, 4);
        memcpy(&speed, answer + 8 + 296, 4);
        char words[64];
        int count = sprintf(words, "0 %d %u %u", line, ntohl(bus) << 16 | ntohl(number), ntohl(speed));
        int attach = open(CONTROLLER "attach", O_WRONLY);
        done = attach >= 0 && write(attach, words, count) == count;
        if (!done) perror("plug: attach");
        if (attach >= 0) close(attach);
    }
    /* The kernel has its own hold on the connection. */
    close(line);
    return done;
}

int main(int count, char **words) {
    struct sockaddr_in where = {.sin_family = AF_INET};
    if (count != 3 || !inet_aton(words[1], &where.sin_addr)) return 2;
    where.sin_port = htons((uint16_t)atoi(words[2]));
    for (;;) {
        if (empty()) plug(&where);
        usleep(200 * 1000);
    }
}

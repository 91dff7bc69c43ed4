/* The firmware's frame reader on a computer: bytes on stdin, what it finds on stdout, a line each: `good SS BODY` or `bad`. */
#include <stdio.h>

#include "../../../firmware/frame.h"

int main(void) {
    static struct frame_reader reader;
    for (int byte = getchar(); byte != EOF; byte = getchar()) {
        switch (frame_take(&reader, (char)byte)) {
        case FRAME_GOOD: printf("good %02X %s\n", reader.seq, reader.body); break;
        case FRAME_BAD: puts("bad"); break;
        case FRAME_NONE: break;
        }
    }
    return 0;
}

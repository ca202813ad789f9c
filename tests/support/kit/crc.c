/* The CRC of adhesion.c alone: lines "DATA_ID HEX", both in hexadecimal; answers with the CRC. */
#include "adhesion.c"

#include <stdio.h>
#include <string.h>

int main(void)
{
    unsigned data_id;
    char hex[129];
    while (scanf("%x %128s", &data_id, hex) == 2) {
        uint8_t data[64] = {0};
        const size_t length = strlen(hex) / 2U;
        for (size_t at = 0U; at < length; at++) {
            unsigned byte;
            if (sscanf(&hex[2U * at], "%2x", &byte) != 1) {
                return 2;
            }
            data[at] = (uint8_t)byte;
        }
        printf("%02x\n", crc_of((uint16_t)data_id, data, (uint8_t)length));
    }
    return 0;
}

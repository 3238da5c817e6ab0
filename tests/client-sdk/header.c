/* tessera.h is C: this is compiled as such, by pkg-config, against an installed tree. */
#include <stdio.h>
#include <tessera/tessera.h>

int main(void) {
  TesseraSessionCreateInfo info = {TESSERA_TYPE_SESSION_CREATE_INFO};
  TesseraSession session = NULL;
  TesseraResult result;
  info.apiVersion = TESSERA_API_VERSION;
  info.ticket = "nonsense";
  if (tesseraGetVersion() != TESSERA_API_VERSION) return 1;
  result = tesseraCreateSession(&info, &session);
  printf("%s: %s\n", tesseraResultToString(result), tesseraGetLastErrorText());
  return tesseraDestroySession(session) == TESSERA_SUCCESS ? 0 : 1;
}
